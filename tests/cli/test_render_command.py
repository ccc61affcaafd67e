"""`vpltune render`: every layer reaches its file, in the form that the file's name asks for."""

import json
import re
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from PIL import Image

from vpltune.cli.options import (
    InterleaveOption,
    Layer,
    MapRefinementOption,
    MapSizeOption,
    RsmResolutionOption,
)
from vpltune.cli.program import run
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import (
    INTERLEAVES,
    LARGEST_MAP,
    LARGEST_RSM,
    MAP_REFINEMENTS,
    SMALLEST_MAP,
    SMALLEST_RSM,
    Quality,
)
from vpltune.renderer.config.tuned_config import TunedConfig, write_config
from vpltune.renderer.errors import MachineError
from vpltune.renderer.files.image_file import read_exr
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.views import View, write_views

SCENE = Path(__file__).resolve().parents[2] / "configs" / "scenes" / "cornell-box.glb"
LAYERS = get_args(Layer)
SIZE = (32, 24)
FEW = TunedConfig(ArtistParameters(vpl_count=64), quality=Quality(rsm_resolution=128))


@pytest.fixture(scope="module")
def views_path(tmp_path_factory) -> Path:
    """Two views of the shipped box, by its own camera: one by its own light, one in the dark."""
    scene = read_scene(SCENE)
    (camera,), lights = scene.cameras, scene.lights
    path = tmp_path_factory.mktemp("views") / "views.json"
    write_config(path.with_name("few.json"), FEW)
    write_views(
        path,
        str(SCENE),
        (View("front", "fitted", SIZE, camera, lights), View("dark", "held_out", (8, 8), camera, ())),
    )
    return path


def render(views_path, output, *more):
    """The command with few VPLs, where `more` gives no other config: what they light is not the subject."""
    config = () if "--config" in more else ("--config", str(views_path.with_name("few.json")))
    views = ("--views", str(views_path), "--view", "front")
    return run(["render", str(SCENE), "-o", str(output), *config, *views, *more])


@pytest.mark.parametrize("layer", LAYERS)
def test_every_layer_is_a_image_and_an_exr(views_path, tmp_path, layer):
    for name in ("a.png", "a.exr"):
        assert render(views_path, tmp_path / name, "--layer", layer) == 0
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == SIZE
        assert np.asarray(image).max() > 50
    pixels = read_exr(tmp_path / "a.exr")
    assert pixels.shape == ((24, 32) if layer == "depth" else (24, 32, 3))
    assert pixels.dtype == np.float32
    assert np.isfinite(pixels).all()
    assert pixels.max() > 0.0


def test_a_config_that_says_nothing_of_quality_is_drawn_with_the_defaults(views_path, tmp_path):
    """`render` has none of its own."""
    drawn = {}
    for refinement in (None, 1):
        more = () if refinement is None else (f"--map-refinement={refinement}",)
        assert (
            render(views_path, tmp_path / "a.exr", "--layer", "irradiance", "--config", "default", *more) == 0
        )
        drawn[refinement] = read_exr(tmp_path / "a.exr")
    scene = read_scene(SCENE)
    (camera,) = scene.cameras
    view = View("front", "fitted", SIZE, camera, scene.lights)
    ours = Runtime(scene).render(view, TunedConfig(), layer="irradiance")
    np.testing.assert_array_equal(drawn[None], ours)
    assert (drawn[1] != ours).any()


def test_the_help_states_the_ranges_that_a_config_has():
    named = {
        InterleaveOption: ("1|2|4|8", INTERLEAVES),
        MapRefinementOption: ("1|2|4|8", MAP_REFINEMENTS),
        MapSizeOption: ("from 4 to 64", (SMALLEST_MAP, LARGEST_MAP)),
        RsmResolutionOption: ("from 64 to 8192", (SMALLEST_RSM, LARGEST_RSM)),
    }
    for option, (words, numbers) in named.items():
        (shown,) = option.__metadata__
        assert words in f"{shown.metavar} {shown.help}"
        assert [int(number) for number in re.findall("[0-9]+", words)] == list(numbers)
        assert shown.help.endswith("overrides the config.")


def test_interleaved_images_are_near_the_full_one(views_path, tmp_path):
    """Their energy within 5 %: at 32×24, one pixel in five stands at an edge."""
    means = []
    for n in ("1", "4"):
        path = tmp_path / f"{n}.exr"
        assert render(views_path, path, "--layer", "irradiance", "--interleave", n) == 0
        means.append(float(read_exr(path).mean()))
    assert means[0] != means[1]
    assert means[1] == pytest.approx(means[0], rel=0.05)


def test_exr_of_final_is_the_radiance_before_the_tone_curve(views_path, tmp_path):
    pixels = {}
    for layer in ("final", "direct", "indirect"):
        assert render(views_path, tmp_path / f"{layer}.exr", "--layer", layer) == 0
        pixels[layer] = read_exr(tmp_path / f"{layer}.exr")
    # The runtime keeps radiance in half precision at the least: eleven bits, twice rounded.
    total = pixels["direct"] + pixels["indirect"]
    np.testing.assert_allclose(pixels["final"], total, rtol=2e-3, atol=1e-3 * total.mean())


def test_dynamic_lights_add_to_direct_light_only(views_path, tmp_path):
    pixels = {}
    for layer in ("direct", "indirect"):
        for count in ("0", "100"):
            name = f"{layer}{count}.exr"
            assert render(views_path, tmp_path / name, "--layer", layer, "--dynamic-lights", count) == 0
            pixels[layer, count] = read_exr(tmp_path / name)
    added = pixels["direct", "100"] - pixels["direct", "0"]
    assert (added >= 0.0).all()
    # They stand out beside the light of the view, and do not outshine it.
    assert 0.02 < added.mean() / pixels["direct", "0"].mean() < 1.0
    np.testing.assert_array_equal(pixels["indirect", "100"], pixels["indirect", "0"])


def test_images_of_a_scaled_scene_are_the_same(views_path, tmp_path):
    for name, scale in (("one.exr", "1"), ("hundred.exr", "100")):
        assert render(views_path, tmp_path / name, "--layer", "irradiance", "--scale", scale) == 0
    one, hundred = read_exr(tmp_path / "one.exr"), read_exr(tmp_path / "hundred.exr")
    # 1e-3 relative RMSE is what the project promises of scale.
    assert np.sqrt(((one - hundred) ** 2).mean() / (one**2).mean()) < 1e-3


def test_a_size_on_the_command_line_goes_before_the_views(views_path, tmp_path, capfd):
    assert render(views_path, tmp_path / "a.png", "--size", "20x10", "--json") == 0
    document = json.loads(capfd.readouterr().out)
    assert document["view"]["size"] == [20, 10]
    assert document["view"]["name"] == "front"
    assert document["status"] == "ok"
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (20, 10)


def test_camera_and_light_from_flags(tmp_path, capfd):
    arguments = [
        "--eye",
        "0,0,1",
        "--look-at",
        "0,0,0",
        "--light-type",
        "point",
        "--light-position",
        "0,0,0.5",
    ]
    assert (
        run(["render", str(SCENE), "-o", str(tmp_path / "a.png"), "--size", "8x8", "--json", *arguments]) == 0
    )
    view = json.loads(capfd.readouterr().out)["view"]
    assert view["camera"]["to_world"] == [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 0, 0, 1]
    assert [light["type"] for light in view["lights"]] == ["point"]


def test_a_scene_gets_camera_and_light_by_itself(tmp_path):
    assert run(["render", str(SCENE), "-o", str(tmp_path / "a.png"), "--size", "32x24"]) == 0
    with Image.open(tmp_path / "a.png") as image:
        assert np.asarray(image).std() > 5


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--view", "back"], "--view: .*views.json has front, dark, got 'back'"),
        ([], "--view: must be given: .*views.json has front, dark"),
        (
            ["--view", "front", "--eye", "0,0,1", "--look-at", "0,0,0"],
            "--views: has its own camera and lights",
        ),
    ],
)
def test_views_that_cannot_be_are_refused(views_path, tmp_path, capfd, more, message):
    arguments = ["render", str(SCENE), "-o", str(tmp_path / "a.png"), "--views", str(views_path), *more]
    assert run(arguments) == 2
    error = capfd.readouterr().err
    assert re.search(message, error)
    assert error.count("\n") == 1
    assert not (tmp_path / "a.png").exists()


def test_an_output_in_the_way_is_refused_after_drawing(views_path, tmp_path, capfd):
    (tmp_path / "a.png").mkdir()
    assert render(views_path, tmp_path / "a.png") == 2
    assert "a.png" in capfd.readouterr().err


def test_no_opengl_is_exit_code_3(views_path, tmp_path, monkeypatch, capfd):
    def refuse(self, *arguments, **options):
        raise MachineError("no headless OpenGL context; run: vpltune doctor")

    monkeypatch.setattr(Runtime, "__init__", refuse)
    assert render(views_path, tmp_path / "a.png") == 3
    assert capfd.readouterr().err == "vpltune: no headless OpenGL context; run: vpltune doctor\n"
