"""VPLs placed where the camera would miss them: the same light in the mean, and less noise in the image."""

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view
from converged_views import corner_view
from point_vpls import point_vpls

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import Camera, scaled
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View, scaled_view


def config_with(**parameters) -> TunedConfig:
    """With small visibility maps: images are compared with one another, all of which have them."""
    quality = Quality(rsm_resolution=256, map_size=8, map_refinement=1)
    return TunedConfig(point_vpls(**parameters), quality=quality, light=ONE_BOUNCE)


@pytest.fixture(scope="module")
def room(gl_context) -> Runtime:
    return Runtime(colored_room(), context=gl_context)


def irradiances(runtime: Runtime, view: View, config: TunedConfig, rotations: int) -> np.ndarray:
    shifts = [(float(u), float(v)) for u, v in np.random.default_rng(3).random((rotations, 2))]
    frames = runtime.captures(view, config, shifts)
    return np.array([frame.indirect_irradiance[frame.valid] for frame in frames], np.float64)


@pytest.mark.parametrize(
    ("density_importance", "tolerance", "light"),
    [
        pytest.param(
            importance,
            tolerance,
            light,
            marks=() if importance == 1.0 and light in ("spot", "directional") else pytest.mark.slow,
        )
        for importance, tolerance in ((0.5, 0.01), (1.0, 0.015))
        for light in ROOM_LIGHTS
    ],
)
def test_the_mean_over_rotations_is_the_same_light(room, light, density_importance, tolerance):
    """48 rotations of 256 VPLs give the image of 32,768: mean and middle pixel within `tolerance`.

    With η = 0.5 the mean was off by up to 0.7 %, and the middle pixel by 0.5 %; with η = 1, by 1.1 and 0.9 %:
    a twentieth of the VPLs is then drawn by flux alone, and what they find in the corner is left to chance.

    α is small, so that footprints, which depend on density, take little light away; pixels in corners, where
    1/d² then runs free, are noisy (RMS over all of them 2 to 16 %), so the middle one is looked at.
    """
    view = corner_view(light)
    truth = irradiances(room, view, config_with(vpl_count=32768, falloff_footprint=0.05), 1)[0]
    config = config_with(vpl_count=256, falloff_footprint=0.05, density_importance=density_importance)
    mean = irradiances(room, view, config, 48).mean(axis=0)
    assert mean.mean() == pytest.approx(truth.mean(), rel=tolerance)
    seen = truth > 0.0
    assert np.median(np.abs(mean[seen] - truth[seen]) / truth[seen]) < tolerance


@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_less_noise_where_the_camera_looks(room, light):
    """At equal count, relative variance over rotations falls: near a corner by a third at least."""
    view = corner_view(light)
    variance = {}
    for density_importance in (0.0, 1.0):
        config = config_with(vpl_count=64, density_importance=density_importance)
        images = irradiances(room, view, config, 24)
        mean = images.mean(axis=0)
        variance[density_importance] = np.mean(images.var(axis=0) / (mean**2 + 0.01 * mean.mean() ** 2))
    assert variance[1.0] < 0.67 * variance[0.0], variance


def test_places_that_see_nothing_say_nothing(room):
    """Where most of the image is sky, importance still comes from the rest of it."""
    camera = Camera(look_at(np.array([-1.0, 0.5, 8.0]), np.array([0.9, -0.7, -1.0])), 0.6)
    view = View("past", "fitted", (48, 36), camera, (ROOM_LIGHTS["spot"],))
    drawn = room.draw(view, config_with(vpl_count=64, density_importance=1.0))
    factor = np.frombuffer(drawn.frame.resources.read("vpl_importance"), np.float32)
    assert np.isfinite(factor).all()
    assert factor.max() > 2.0 * factor[factor > 0.06].min()


@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_importance_has_no_unit(gl_context, room, factor):
    """Scene, camera and light scaled together: the same VPLs, to 1e-3 relative RMSE of the image."""
    view = room_view("spot", (32, 24))
    config = config_with(vpl_count=64, density_importance=1.0)
    image = room.render_radiance(view, config)
    other = Runtime(scaled(colored_room(), factor), context=gl_context)
    grown = other.render_radiance(scaled_view(view, factor), config)
    assert np.sqrt(np.mean((grown - image) ** 2) / np.mean(image**2)) < 1e-3


@pytest.mark.parametrize("lloyd_iterations", [0, 4])
def test_many_rotations_of_one_view_are_bitwise_those_of_one_frame_each(room, lloyd_iterations):
    """What does not depend on the rotation is drawn once, and nothing of one rotation is left in the next."""
    options = {"vpl_count": 64, "density_importance": 0.7, "screen_space_strength": 1.0}
    config = config_with(**options, lloyd_iterations=lloyd_iterations)
    view, rotations = corner_view("spot"), ((0.0, 0.0), (0.3, 0.7), (0.9, 0.1))
    for rotation, captured in zip(rotations, room.captures(view, config, rotations), strict=True):
        alone = room.capture(view, config, table_rotation=rotation)
        for name in ("vpl_position_world", "vpl_flux", "direct_irradiance", "indirect_irradiance"):
            assert np.array_equal(getattr(captured, name), getattr(alone, name)), name


@pytest.mark.parametrize("lloyd_iterations", [0, 4])
def test_frames_repeat_bitwise(room, lloyd_iterations):
    config = config_with(vpl_count=64, density_importance=0.7, lloyd_iterations=lloyd_iterations)
    first = room.capture(room_view("point", (32, 24)), config)
    room.capture(room_view("spot", (32, 24)), config)
    again = room.capture(room_view("point", (32, 24)), config)
    np.testing.assert_array_equal(again.vpl_position_world, first.vpl_position_world)
    np.testing.assert_array_equal(again.indirect_irradiance, first.indirect_irradiance)


def test_a_dark_view_is_no_error(room):
    """No light, or nothing seen: finite, and black."""
    config = config_with(vpl_count=64, density_importance=1.0)
    assert not room.capture(room_view(None, (16, 12)), config).indirect_irradiance.any()
    away = Camera(look_at(np.array([0.0, 0.0, 5.0]), np.array([0.0, 0.0, 9.0])), 0.5)
    frame = room.capture(View("away", "fitted", (16, 12), away, (ROOM_LIGHTS["spot"],)), config)
    assert np.isfinite(frame.vpl_flux).all()


@pytest.mark.slow
def test_near_field_follows_importance(room):
    """The screen-space term knows the footprints that VPLs have: energy stays with and without importance.

    Within 4 %: it gives back what softened VPLs withhold, from the screen and filtered.
    """
    view = corner_view("spot", (64, 48))
    truth = irradiances(room, view, config_with(vpl_count=16384, falloff_footprint=0.1), 1)[0].mean()
    for density_importance in (0.0, 1.0):
        config = config_with(
            vpl_count=256,
            falloff_footprint=1.0,
            density_importance=density_importance,
            screen_space_strength=1.0,
        )
        assert irradiances(room, view, config, 16).mean() == pytest.approx(truth, rel=4e-2)
