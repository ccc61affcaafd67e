"""Scene statistics: the GPU agrees with the numpy twin; they are finite ratios, independent of scale."""

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.scene_statistics import STATISTIC_NAMES
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import Camera, look_at, scaled
from vpltune.renderer.scene.views import View, scaled_view
from vpltune.tuner.surrogate.scene_statistics import scene_statistics


def runtime_of(context, visibility="maps", vpl_count=64, factor=1.0) -> Runtime:
    config = TunedConfig(ArtistParameters(vpl_count=vpl_count), visibility=visibility)
    return Runtime(scaled(colored_room(), factor), config, context=context, rsm_resolution=256)


def measured(runtime: Runtime, view: View) -> np.ndarray:
    runtime.draw(view)
    return runtime.scene_statistics(view)


@pytest.mark.parametrize("visibility", ["maps", "none"])
@pytest.mark.parametrize("light", ROOM_LIGHTS)
@pytest.mark.parametrize("vpl_count", [3, 300])
def test_twins_agree(gl_context, light, visibility, vpl_count):
    """They agree to 2e-3: pixels at a shadow edge, or in the plane of a VPL, may fall either way."""
    runtime = runtime_of(gl_context, visibility, vpl_count)
    captured = runtime.capture(room_view(light))
    ours = runtime.scene_statistics(room_view(light))
    np.testing.assert_allclose(ours, scene_statistics(captured), atol=2e-3)


@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_statistics_have_no_unit(gl_context, light):
    """Scaling scene and light by 0.01 and 100 changes nothing but pixels that rounding moves across edges."""
    plain = measured(runtime_of(gl_context), room_view(light))
    for factor in (0.01, 100.0):
        other = measured(runtime_of(gl_context, factor=factor), scaled_view(room_view(light), factor))
        np.testing.assert_allclose(other, plain, atol=1e-3)


@pytest.mark.parametrize("light", [None, *ROOM_LIGHTS])
def test_statistics_are_ratios(gl_context, light):
    """They are finite and in [0, 1], with and without light, and if the camera sees nothing."""
    runtime = runtime_of(gl_context)
    away = Camera(look_at(np.array([0.0, 0.0, 3.6]), np.array([0.0, 0.0, 9.0])), 0.7)
    view = room_view(light)
    for drawn in (view, View("away", "fitted", view.size, away, view.lights)):
        found = measured(runtime, drawn)
        assert np.isfinite(found).all()
        assert (found >= 0.0).all() and (found <= 1.0).all()


def test_darkness_has_its_own_numbers(gl_context):
    """Without light, `visible` is 1, and every other statistic of the light is 0."""
    found = dict(zip(STATISTIC_NAMES, measured(runtime_of(gl_context), room_view(None)), strict=True))
    assert found.pop("visible") == 1.0
    assert found.pop("vpl_count") == pytest.approx(6.0 / 16.0)
    assert not any(found.values())
