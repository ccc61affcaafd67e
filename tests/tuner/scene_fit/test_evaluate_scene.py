"""An evaluation measures what the config draws: its quality counts as its parameters do."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.views import View
from vpltune.tuner.scene_fit.evaluate_scene import EvaluateOptions, SceneEvaluation, evaluate_scene
from vpltune.tuner.scene_fit.fit_scene import default_like

SCENE = Path(__file__).resolve().parents[3] / "configs" / "scenes" / "cornell-box.glb"
FINE = TunedConfig(ArtistParameters(intensity=1.2, vpl_count=64), light=ONE_BOUNCE)
COARSE = replace(FINE, quality=Quality(4, 8, 2, 256))


@pytest.fixture(scope="module")
def view() -> View:
    scene = read_scene(SCENE)
    return View("front", "fitted", (32, 24), scene.cameras[0], scene.lights)


@pytest.fixture(scope="module")
def evaluated(view) -> dict[str, SceneEvaluation]:
    """The same parameters, measured with the default quality and with a coarse one."""
    return {
        name: evaluate_scene(
            SCENE,
            EvaluateOptions(tuned=config, fixed_views=(view,), split_error=True),
            lambda stage, share: None,
        )
        for name, config in (("fine", FINE), ("coarse", COARSE))
    }


def test_its_images_are_those_of_the_config(evaluated, view, gl_context):
    """Bit for bit, and the default differs from it in its parameters alone."""
    runtime = Runtime(read_scene(SCENE), context=gl_context)
    for name, config in (("fine", FINE), ("coarse", COARSE)):
        (found,) = evaluated[name].evaluation.views
        default = config.with_parameters(default_like(config.parameters))
        for variant, drawn in (("tuned", config), ("default", default)):
            image = runtime.render(view, drawn, layer="irradiance")
            np.testing.assert_array_equal(found.irradiance[variant], image)


def test_the_quality_counts_and_is_told(evaluated):
    fine, coarse = (evaluated[name].document for name in ("fine", "coarse"))
    assert (fine["quality"], coarse["quality"]) == (FINE.quality.as_dict(), COARSE.quality.as_dict())
    errors = [each["metrics"]["fitted"]["tuned"]["relmse"] for each in (fine, coarse)]
    assert errors[0] < errors[1]


def test_what_sharing_vpls_among_pixels_costs_is_the_filters_share(evaluated):
    """Beside the surrogate's full gather: next to nothing without, and more with blocks of 4²."""
    fine, coarse = (evaluated[name].document["error_breakdown"]["filter"] for name in ("fine", "coarse"))
    assert abs(coarse) > 10.0 * abs(fine)


def test_a_cache_that_cannot_be_written_to_keeps_no_views(view, tmp_path, monkeypatch):
    """The work is done, and a home may be read-only."""
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("VPLTUNE_CACHE", str(tmp_path / "file"))
    options = EvaluateOptions(tuned=FINE, fixed_views=(view,))
    document = evaluate_scene(SCENE, options, lambda stage, share: None).document
    assert document["views"] is None
    assert document["notes"][-1].startswith(f"the views are not kept: {tmp_path / 'file' / 'views'}")


@pytest.mark.parametrize("split", ["held_out", "validation"])
def test_views_of_ones_own_need_a_fitted_one(view, split):
    options = EvaluateOptions(tuned=FINE, fixed_views=(replace(view, split=split),))
    with pytest.raises(InputError, match="views: at least one must have the split"):
        evaluate_scene(SCENE, options, lambda stage, share: None)
