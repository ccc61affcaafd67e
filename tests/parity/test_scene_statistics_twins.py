"""Scene statistics: the GPU agrees with the numpy twin; they are finite ratios, independent of scale."""

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.scene_statistics import STATISTIC_NAMES
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import Camera, scaled
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View, scaled_view
from vpltune.tuner.surrogate.scene_statistics import scene_statistics


def config_with(visibility="maps", vpl_count=64) -> TunedConfig:
    quality = Quality(rsm_resolution=256)
    return TunedConfig(ArtistParameters(vpl_count=vpl_count), visibility=visibility, quality=quality)


def measured(context, view: View, factor=1.0) -> np.ndarray:
    runtime = Runtime(scaled(colored_room(), factor), context=context)
    return runtime.draw(view, config_with()).read_statistics()


@pytest.mark.parametrize("visibility", ["maps", "transmittance"])
@pytest.mark.parametrize("light", ROOM_LIGHTS)
@pytest.mark.parametrize("vpl_count", [3, 300])
def test_twins_agree(gl_context, light, visibility, vpl_count):
    """They agree to 2e-3: pixels at a shadow edge, or in the plane of a VPL, may fall either way."""
    runtime = Runtime(colored_room(), context=gl_context)
    drawn = runtime.draw(room_view(light), config_with(visibility, vpl_count))
    np.testing.assert_allclose(drawn.read_statistics(), scene_statistics(drawn.capture()), atol=2e-3)


@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_statistics_have_no_unit(gl_context, light):
    """Scaling scene and light by 0.01 and 100 changes nothing but pixels that rounding moves across edges."""
    plain = measured(gl_context, room_view(light))
    for factor in (0.01, 100.0):
        other = measured(gl_context, scaled_view(room_view(light), factor), factor)
        np.testing.assert_allclose(other, plain, atol=1e-3)


@pytest.mark.parametrize("light", [None, *ROOM_LIGHTS])
def test_statistics_are_ratios(gl_context, light):
    """They are finite and in [0, 1], with and without light, and if the camera sees nothing."""
    away = Camera(look_at(np.array([0.0, 0.0, 3.6]), np.array([0.0, 0.0, 9.0])), 0.7)
    view = room_view(light)
    for drawn in (view, View("away", "fitted", view.size, away, view.lights)):
        found = measured(gl_context, drawn)
        assert np.isfinite(found).all()
        assert (found >= 0.0).all() and (found <= 1.0).all()


def test_darkness_has_its_own_numbers(gl_context):
    """Without light, `visible` is 1, and every other statistic of the light is 0."""
    found = dict(zip(STATISTIC_NAMES, measured(gl_context, room_view(None)), strict=True))
    assert found.pop("visible") == 1.0
    assert found.pop("vpl_count") == pytest.approx(6.0 / 16.0)
    assert not any(found.values())
