"""What a config says is what every command draws with; a flag overrides it, and says so."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from config_documents import OLDER_QUALITY

import vpltune.tuner.batch.batch
import vpltune.tuner.scene_fit.evaluate_scene
import vpltune.tuner.scene_fit.fit_scene
from vpltune.cli.program import run
from vpltune.cli.quality_flags import with_flags
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.gltf_extras import EXTRAS_KEY, read_gltf_extras, write_gltf_extras
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import MetBudget, Quality
from vpltune.renderer.config.tuned_config import (
    FitNote,
    TunedConfig,
    config_text,
    parse_config,
    read_config,
    write_config,
)
from vpltune.renderer.errors import InputError
from vpltune.renderer.files.image_file import read_exr
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.views import View, write_views

SCENE = Path(__file__).resolve().parents[2] / "configs" / "scenes" / "cornell-box.glb"
QUALITY = Quality(interleave=4, map_size=8, map_refinement=2, rsm_resolution=256)
CONFIG = TunedConfig(ArtistParameters(vpl_count=64), quality=QUALITY)
OVERRIDES = [
    ("interleave", 1, 4),
    ("map_size", 16, 8),
    ("map_refinement", 1, 2),
    ("rsm_resolution", 512, 256),
]
"""Field of the quality, what a flag says, and what the config has."""

VERSION_1 = {
    "format": "vpltune",
    "version": 1,
    "visibility": "none",
    "parameters": {
        "intensity": 1.5,
        "falloff_footprint": 0.75,
        "falloff_transmittance": 2.0,
        "visibility_bias": 0.0005,
        "visibility_softness": 0.001,
        "vpl_count": 64,
        "density_exponent": 0.5,
        "density_importance": 0.25,
        "density_relaxation": 2,
        "screen_space_radius": 3.0,
        "screen_space_strength": 0.0,
    },
    "provenance": {"scene": "box", "status": "kept", "fit": "no gain"},
}
"""A config as version 0.1.0 wrote it."""
BROUGHT_FORWARD = TunedConfig(
    ArtistParameters(
        intensity=1.5,
        falloff_footprint=0.75,
        extinction_coefficient=0.0,
        vpl_count=64,
        density_exponent=0.5,
        density_importance=0.25,
        lloyd_iterations=2,
    ),
    {"scene": "box"},
    "transmittance",
    quality=OLDER_QUALITY,
    fit=FitNote("kept", "no gain"),
    light=ONE_BOUNCE,
)


@pytest.fixture(scope="module")
def view() -> View:
    """The shipped box by its own camera and light."""
    scene = read_scene(SCENE)
    return View("front", "fitted", (32, 24), scene.cameras[0], scene.lights)


@pytest.fixture(scope="module")
def views_path(view, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("views") / "views.json"
    write_views(path, str(SCENE), (view,))
    return path


@pytest.fixture(scope="module")
def runtime(gl_context) -> Runtime:
    return Runtime(read_scene(SCENE), context=gl_context)


@pytest.fixture
def config_path(tmp_path) -> Path:
    write_config(tmp_path / "tuned.json", CONFIG)
    return tmp_path / "tuned.json"


@pytest.fixture
def rendered(views_path, tmp_path):
    """Draws the irradiance with `vpltune render`: a config's path and more flags to pixels."""

    def render(config_path, *more) -> np.ndarray:
        arguments = ["--views", str(views_path), "--layer", "irradiance", "--config", str(config_path), *more]
        assert run(["render", str(SCENE), "-o", str(tmp_path / "a.exr"), *arguments]) == 0
        return read_exr(tmp_path / "a.exr")

    return render


@pytest.fixture
def starts(monkeypatch):
    """What `fit`, `batch` and `evaluate` start with; in the place of the work itself, they are refused."""
    seen: list[TunedConfig] = []

    def fit_scene(scene, output, options, progress):
        seen.append(options.start)
        raise InputError("seen")

    def run_batch(library, output, options, *more, **named):
        seen.append(options.fit_options(None).start)
        raise InputError("seen")

    def evaluate_scene(scene, options, progress):
        seen.append(options.tuned)
        raise InputError("seen")

    monkeypatch.setattr(vpltune.tuner.scene_fit.fit_scene, "fit_scene", fit_scene)
    monkeypatch.setattr(vpltune.tuner.batch.batch, "run_batch", run_batch)
    monkeypatch.setattr(vpltune.tuner.scene_fit.evaluate_scene, "evaluate_scene", evaluate_scene)
    return seen


def commands(config_path, folder) -> dict[str, list[str]]:
    """Every command that takes a config, with this one; outputs go into `folder`."""
    out, scene, named = str(folder / "out"), str(SCENE), ["--config", str(config_path)]
    return {
        "fit": ["fit", scene, "-o", out, *named],
        "batch": ["batch", str(SCENE.parent), "-o", out, *named],
        "evaluate": ["evaluate", scene, *named],
        "render": ["render", scene, "-o", f"{out}.png", "--size", "8x8", *named],
        "export": ["export", str(config_path), "--to", "json", "-o", f"{out}.json"],
    }


def flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def test_render_draws_with_the_quality_of_the_config(rendered, config_path, runtime, view, capfd):
    """Bit for bit what the runtime draws with that config, and not what any other setting would give."""
    drawn = rendered(config_path)
    assert "overrides" not in capfd.readouterr().err
    np.testing.assert_array_equal(drawn, runtime.render(view, CONFIG, layer="irradiance"))
    for name in ("interleave", "map_size", "map_refinement", "rsm_resolution"):
        other = replace(QUALITY, **{name: getattr(Quality(), name)})
        image = runtime.render(view, replace(CONFIG, quality=other), layer="irradiance")
        assert (drawn != image).any(), name
    image = runtime.render(view, replace(CONFIG, quality=Quality()), layer="irradiance")
    assert (drawn != image).any()


@pytest.mark.parametrize(("name", "value", "own"), OVERRIDES)
def test_a_flag_overrides_the_config_and_says_so(
    rendered, config_path, runtime, view, capfd, name, value, own
):
    drawn = rendered(config_path, flag(name), str(value))
    changed = replace(CONFIG, quality=replace(QUALITY, **{name: value}))
    np.testing.assert_array_equal(drawn, runtime.render(view, changed, layer="irradiance"))
    assert capfd.readouterr().err == f"vpltune: {flag(name)} {value} overrides the config, which has {own}\n"


def test_visibility_overrides_the_config_and_says_so(rendered, tmp_path, runtime, view, capfd):
    own = replace(CONFIG, visibility="transmittance")
    write_config(tmp_path / "own.json", own)
    drawn = rendered(tmp_path / "own.json", "--visibility", "maps")
    np.testing.assert_array_equal(drawn, runtime.render(view, CONFIG, layer="irradiance"))
    assert (drawn != runtime.render(view, own, layer="irradiance")).any()
    told = "vpltune: --visibility maps overrides the config, which has transmittance\n"
    assert capfd.readouterr().err == told


@pytest.mark.parametrize("command", ["fit", "batch", "evaluate", "export"])
def test_every_command_says_that_visibility_is_overridden(starts, tmp_path, capfd, command):
    write_config(tmp_path / "own.json", replace(CONFIG, visibility="transmittance"))
    run([*commands(tmp_path / "own.json", tmp_path)[command], "--visibility", "maps"])
    lines = capfd.readouterr().err.splitlines()
    assert lines.count("vpltune: --visibility maps overrides the config, which has transmittance") == 1
    assert (starts or [read_config(tmp_path / "out.json")]) == [CONFIG]


def test_several_flags_are_a_line_each(rendered, config_path, runtime, view, capfd):
    more = [f"{flag(name)}={value}" for name, value, _ in OVERRIDES]
    drawn = rendered(config_path, *more)
    quality = Quality(**{name: value for name, value, _ in OVERRIDES})
    image = runtime.render(view, replace(CONFIG, quality=quality), layer="irradiance")
    np.testing.assert_array_equal(drawn, image)
    lines = capfd.readouterr().err.splitlines()
    assert [line.split()[1] for line in lines] == [flag(name) for name, _, _ in OVERRIDES]


def test_interleaving_takes_a_word_or_a_number():
    changed, notes = with_flags(CONFIG, interleave="auto")
    assert changed.quality == replace(QUALITY, interleave="auto")
    assert notes == ("--interleave auto overrides the config, which has 4",)
    assert with_flags(CONFIG, interleave="2")[0].quality == replace(QUALITY, interleave=2)
    with pytest.raises(InputError, match="--interleave: must be"):
        with_flags(CONFIG, interleave="9" * 5000)  # Python refuses to read so many digits


def test_a_flag_that_changes_nothing_says_nothing(rendered, config_path, runtime, view, capfd):
    drawn = rendered(config_path, *(f"{flag(name)}={own}" for name, _, own in OVERRIDES))
    np.testing.assert_array_equal(drawn, runtime.render(view, CONFIG, layer="irradiance"))
    assert capfd.readouterr().err == ""


def test_a_config_that_says_nothing_of_it_is_not_overridden():
    """Where it has the default, which it may have left out, a flag is no contradiction."""
    changed, notes = with_flags(TunedConfig(), interleave=4, map_size=8, visibility="transmittance")
    assert notes == ()
    assert (changed.quality.interleave, changed.quality.map_size) == (4, 8)
    assert changed.visibility == "transmittance"


def test_a_budget_is_forgotten_with_what_it_was_met_with():
    """A config that no longer draws as it was measured does not say that it meets a budget."""
    met = replace(CONFIG, quality=replace(QUALITY, budget=MetBudget(5.0, (64, 48), "a machine")))
    assert with_flags(met)[0] == met
    assert with_flags(met, interleave=2)[0].quality == replace(QUALITY, interleave=2)


@pytest.mark.parametrize(
    ("name", "value", "rule"),
    [
        ("interleave", "3", "must be one of auto, 1, 2, 4, 8, got 3"),
        ("interleave", "0", "must be one of auto, 1, 2, 4, 8, got 0"),
        ("interleave", "full", "must be one of auto, 1, 2, 4, 8, got 'full'"),
        ("map_size", "3", "must be a whole number from 4 to 64, got 3"),
        ("map_size", "65", "must be a whole number from 4 to 64, got 65"),
        ("map_refinement", "16", "must be one of 1, 2, 4, 8, got 16"),
        ("rsm_resolution", "63", "must be a whole number from 64 to 8192, got 63"),
        ("rsm_resolution", "8193", "must be a whole number from 64 to 8192, got 8193"),
    ],
)
def test_a_value_out_of_range_is_refused_in_one_line(tmp_path, capfd, name, value, rule):
    """Before the scene is read: there is none."""
    output = tmp_path / "a.png"
    assert run(["render", "absent.glb", "-o", str(output), f"{flag(name)}={value}"]) == 2
    assert capfd.readouterr().err == f"vpltune: {flag(name)}: {rule}\n"
    assert not list(tmp_path.iterdir())


def test_a_visibility_that_is_no_more_is_refused(tmp_path, capfd):
    assert run(["render", "absent.glb", "-o", str(tmp_path / "a.png"), "--visibility", "none"]) == 2
    told = capfd.readouterr().err
    assert re.search("--visibility.*'none' is not one of 'transmittance', 'maps'", told)
    assert told.count("\n") == 1


def edit_by_hand(path: Path) -> TunedConfig:
    """Another intensity, the checksum left as it is; what the file then ought to hold."""
    document = json.loads(path.read_text(encoding="utf-8"))
    document["parameters"]["intensity"] = 2.5
    path.write_text(json.dumps(document), encoding="utf-8")
    return CONFIG.with_parameters(replace(CONFIG.parameters, intensity=2.5))


@pytest.mark.parametrize("command", ["fit", "batch", "evaluate", "render", "export"])
def test_a_config_edited_by_hand_is_refused_by_every_command(config_path, tmp_path, capfd, starts, command):
    edit_by_hand(config_path)
    assert run(commands(config_path, tmp_path)[command]) == 2
    told = capfd.readouterr().err
    assert told.startswith(f"vpltune: {config_path}: key 'checksum' does not fit the values")
    assert told.count("\n") == 1
    assert not starts
    assert list(tmp_path.iterdir()) == [config_path]


@pytest.mark.parametrize("name", ["tuned.json", "my 'best' config.json"])
def test_the_command_that_renews_a_checksum_is_told_and_works(rendered, runtime, view, tmp_path, capfd, name):
    path = tmp_path / name
    write_config(path, CONFIG)
    expected = edit_by_hand(path)
    assert run(["render", str(SCENE), "-o", str(tmp_path / "b.png"), "--config", str(path)]) == 2
    _, _, command = capfd.readouterr().err.rstrip("\n").partition("renew it: vpltune ")
    assert run(shlex.split(command)) == 0
    assert read_config(path) == expected
    np.testing.assert_array_equal(rendered(path), runtime.render(view, expected, layer="irradiance"))


def test_the_command_that_renews_a_checksum_in_a_scene_leaves_the_scene(tmp_path, capfd):
    """The config lies in a .glb: JSON in its place would be the end of the scene."""
    path = tmp_path / "tuned.glb"
    write_gltf_extras(SCENE, path, json.loads(config_text(CONFIG)))
    document = read_gltf_extras(path)
    document["parameters"]["intensity"] = 2.5
    write_gltf_extras(path, path, document)
    assert run(["export", str(path), "--to", "glsl", "-o", str(tmp_path / "a.glsl")]) == 2
    _, _, command = capfd.readouterr().err.rstrip("\n").partition("renew it: vpltune ")
    assert run(shlex.split(command)) == 0
    assert read_config(path) == CONFIG.with_parameters(replace(CONFIG.parameters, intensity=2.5))
    before, after = read_scene(SCENE), read_scene(path)
    for mesh, same in zip(before.meshes, after.meshes, strict=True):
        np.testing.assert_array_equal(mesh.positions, same.positions)
    assert EXTRAS_KEY in path.read_bytes().decode("latin-1")


@pytest.mark.parametrize("form", ["glsl", "c", "std140", "bundle", "web"])
def test_a_checksum_is_renewed_only_where_it_is_written(config_path, tmp_path, capfd, form):
    edit_by_hand(config_path)
    scene = ["--scene", str(SCENE)] if form in ("bundle", "web") else []
    arguments = ["export", str(config_path), "--to", form, "-o", str(tmp_path / "a.html"), *scene]
    assert run([*arguments, "--renew-checksum"]) == 2
    told = f"vpltune: --renew-checksum: needs --to json or gltf, got --to {form}\n"
    assert capfd.readouterr().err == told


def test_a_renewed_config_is_still_checked(config_path, tmp_path, capfd):
    document = json.loads(config_path.read_text(encoding="utf-8"))
    document["quality"]["map_size"] = 3
    config_path.write_text(json.dumps(document), encoding="utf-8")
    arguments = ["export", str(config_path), "--to", "json", "-o", str(config_path), "--renew-checksum"]
    assert run(arguments) == 2
    told = f"vpltune: {config_path}: quality.map_size: must be a whole number from 4 to 64, got 3\n"
    assert capfd.readouterr().err == told


def test_a_config_formatted_anew_keeps_its_checksum(rendered, config_path, runtime, view):
    """Its values are what is summed up, not its text."""
    document = json.loads(config_path.read_text(encoding="utf-8"))
    config_path.write_text(json.dumps(document, indent=7, sort_keys=True), encoding="utf-8")
    np.testing.assert_array_equal(rendered(config_path), runtime.render(view, CONFIG, layer="irradiance"))


@pytest.mark.parametrize("command", ["fit", "batch", "evaluate"])
def test_commands_start_with_the_quality_of_the_config(starts, config_path, tmp_path, capfd, command):
    assert run(commands(config_path, tmp_path)[command]) == 2
    assert capfd.readouterr().err.endswith("vpltune: seen\n")
    assert starts == [CONFIG]


@pytest.mark.parametrize("command", ["fit", "batch", "evaluate", "render", "export"])
def test_a_config_of_version_1_is_accepted_by_every_command(starts, tmp_path, capfd, command):
    path = tmp_path / "older.json"
    path.write_text(json.dumps(VERSION_1), encoding="utf-8")
    code = run(commands(path, tmp_path)[command])
    if command in ("fit", "batch", "evaluate"):
        assert (code, starts) == (2, [BROUGHT_FORWARD])
    else:
        assert code == 0
    if command == "export":
        assert read_config(tmp_path / "out.json") == BROUGHT_FORWARD
        assert json.loads((tmp_path / "out.json").read_text())["version"] == 2
        assert "from a fit that ended kept: no gain" in capfd.readouterr().err


def test_a_config_of_version_1_draws_as_what_it_is_brought_forward_to(rendered, tmp_path, runtime, view):
    path = tmp_path / "older.json"
    path.write_text(json.dumps(VERSION_1), encoding="utf-8")
    assert parse_config(json.dumps(VERSION_1), "older.json") == BROUGHT_FORWARD
    expected = runtime.render(view, BROUGHT_FORWARD, layer="irradiance")
    np.testing.assert_array_equal(rendered(path), expected)
