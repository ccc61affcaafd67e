"""What `vpltune fit` measured is what every other command draws with its config alone, to a budget or not."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from steady_clock import steady_clock

from vpltune.cli.program import run
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig, read_config, write_config
from vpltune.renderer.files.image_file import read_exr
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.views import read_views
from vpltune.tuner.evaluation.view_images import read_view_images
from vpltune.tuner.frame_time import frame_budget

SCENE = Path(__file__).resolve().parents[2] / "configs" / "scenes" / "cornell-box.glb"
BUDGET = 5.5
"""Milliseconds by the formula: too few for the default's RSM, and some 180 VPLs with what may be chosen."""
CHOICE = {"interleave": 4, "map_size": 8, "rsm_resolution": 256}
"""What is left to choose, and none of it the default."""

pytestmark = pytest.mark.slow  # a fit with a cold reference cache


@pytest.fixture(scope="module", params=["budget", "start"])
def fitted(request, tmp_path_factory):
    """Where the shipped box is fitted: to a budget by the formula, or from a start with the same quality."""
    folder = tmp_path_factory.mktemp(request.param)
    command = ["fit", str(SCENE), "-o", str(folder / "out"), "--views", "1", "--size", "32x24"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("VPLTUNE_CACHE", str(folder / "cache"))
        if request.param == "budget":
            steady_clock(patch)
            patch.setattr(frame_budget, "INTERLEAVES", (CHOICE["interleave"],))
            patch.setattr(frame_budget, "MAP_SIZES", (CHOICE["map_size"],))
            patch.setattr(frame_budget, "HELD_OUT_ROTATIONS", 2)
            patch.setattr(frame_budget, "ROTATIONS", 2)
            command += ["--budget-ms", str(BUDGET)]
        else:
            start = TunedConfig(ArtistParameters(vpl_count=128), quality=Quality(**CHOICE))
            write_config(folder / "start.json", start)
            command += ["--config", str(folder / "start.json")]
        assert run(command) == 0
        yield folder


@pytest.fixture
def document(fitted):
    return json.loads((fitted / "out" / "metrics.json").read_text())


def test_the_config_says_how_it_was_measured(fitted, document):
    quality = read_config(fitted / "out" / "tuned.json").quality
    assert document["quality"] == quality.as_dict()
    assert all(
        getattr(quality, name) == chosen != getattr(Quality(), name) for name, chosen in CHOICE.items()
    )
    if "budget" in document:
        assert document["budget"]["choice"] == CHOICE
        assert (quality.budget.milliseconds, quality.budget.frame_size) == (BUDGET, (32, 24))
    else:
        assert quality == Quality(**CHOICE)


def test_render_draws_what_was_measured(fitted, document, capfd):
    """With no flag but the view's: the runtime's image with that config, and that of images.npz, to the bit.

    images.npz holds half floats, in multiples of its level.
    """
    tuned = fitted / "out" / "tuned.json"
    views = {view.name: view for view in read_views(Path(document["views"]))}
    runtime = Runtime(read_scene(SCENE))
    command = ["render", str(SCENE), "--views", document["views"], "--config", str(tuned)]
    for shown, figures in zip(
        read_view_images(fitted / "out" / "images.npz"), document["per_view"], strict=True
    ):
        view, path = views[figures["name"]], fitted / f"{figures['name']}.exr"
        more = ["--view", view.name, "--layer", "irradiance"]
        assert run([*command, *more, "-o", str(path)]) == 0
        assert capfd.readouterr().err == ""
        drawn = read_exr(path)
        np.testing.assert_array_equal(drawn, runtime.render(view, read_config(tuned), layer="irradiance"))
        kept = (drawn.astype(np.float64) / shown.level).astype(np.float16)
        np.testing.assert_array_equal(kept, shown.indirect["tuned"].astype(np.float16))


def test_render_displays_what_was_measured(fitted, document):
    tuned, view = fitted / "out" / "tuned.json", read_views(Path(document["views"]))[0]
    command = ["render", str(SCENE), "--views", document["views"], "--view", view.name]
    assert run([*command, "--config", str(tuned), "-o", str(fitted / "a.png")]) == 0
    expected = Runtime(read_scene(SCENE)).render(view, read_config(tuned))
    with Image.open(fitted / "a.png") as image:
        np.testing.assert_array_equal(np.asarray(image.convert("RGB")), expected)


def test_evaluate_finds_the_same_figures(fitted, document, capfd):
    """Exactly: the same references from the cache, and the same images.

    The ceiling is fitted anew, with pixels weighted by the image that its views were captured with: 1 %.
    """
    tuned = str(fitted / "out" / "tuned.json")
    assert run(["evaluate", str(SCENE), "--config", tuned, "--views", document["views"], "--json"]) == 0
    again = json.loads(capfd.readouterr().out)
    assert again["quality"] == document["quality"]
    for split in ("fitted", "held_out"):
        for name in ("default", "tuned"):
            assert again["metrics"][split][name] == document["metrics"][split][name]
        ceiling = document["metrics"][split]["ceiling"]
        assert again["metrics"][split]["ceiling"] == pytest.approx(ceiling, rel=1e-2)
