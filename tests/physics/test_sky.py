"""Light from the sky: closed forms over open ground, beside a wall and in a well, and what is seen of it."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import quad, scene_of

from benchmarks.harness.polygon_irradiance import polygon_irradiance
from benchmarks.harness.sky_scenes import RADIANCE, room, table
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import LightSettings
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.environment import Environment, even_sky, solid_angles, texel_directions
from vpltune.renderer.scene.scene import Camera, Scene, scaled
from vpltune.renderer.scene.sky_lights import sky_lights
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View, scaled_view


def config_of(sky_lights: int) -> TunedConfig:
    quality = Quality(interleave=1, map_size=8, rsm_resolution=128)
    return TunedConfig(ArtistParameters(vpl_count=16), quality=quality, light=LightSettings(1, sky_lights))


def under_sky(meshes) -> Scene:
    return replace(scene_of(meshes, [(0.5,) * 3]), environment=even_sky(RADIANCE))


def view_from(eye, target=(0.0, 0.0, 0.0), yfov=0.5) -> View:
    return View("sky", "fitted", (48, 48), Camera(look_at(list(eye), list(target)), yfov), ())


def direct_over_radiance(gl_context, scene: Scene, view: View, lights: int) -> np.ndarray:
    """E ÷ L of the floor's pixels."""
    frame = Runtime(scene, context=gl_context).capture(view, config_of(lights), maps=False)
    floor = frame.valid & (np.abs(frame.normal_world[..., 1]) > 0.9)
    assert floor.sum() > 500
    return frame.direct_irradiance[floor] / np.array(RADIANCE)


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_open_ground_receives_pi_times_the_radiance(gl_context, scale):
    """Within 1 %, at any scale: lights are weighted so that surfaces along the axes are right."""
    scene = scaled(under_sky([quad((-10, 0, -10), (0, 0, 20), (20, 0, 0))]), scale)
    view = scaled_view(view_from((0.0, 3.0, 0.01)), scale)
    got = direct_over_radiance(gl_context, scene, view, 32)
    np.testing.assert_allclose(got, np.pi, rtol=0.01)


def test_under_a_half_infinite_wall_half_the_sky_is_left(gl_context):
    """At its foot a wall hides half of the sky, and half of the irradiance; further off, what 80 × 40 m hide.

    The mean to 2 %.
    """

    ground = quad((-10, 0, -10), (0, 0, 20), (20, 0, 0))
    scene = under_sky([ground, quad((-40, 0, 0), (80, 0, 0), (0, 40, 0))])
    view = view_from((0.0, 2.0, 1.2), (0.0, 0.0, 1.0), 0.3)
    frame = Runtime(scene, context=gl_context).capture(view, config_of(64), maps=False)
    wall = np.array([[-40, 0, 0], [40, 0, 0], [40, 40, 0], [-40, 40, 0]], np.float64)
    hidden = polygon_irradiance(wall, frame.position_world[frame.valid], np.array([0.0, 1.0, 0.0]))
    got = frame.direct_irradiance[frame.valid][:, 0] / RADIANCE[0]
    assert (np.pi - hidden).mean() == pytest.approx(np.pi / 2, rel=0.03)
    assert got.mean() == pytest.approx((np.pi - hidden).mean(), rel=0.02)


def test_the_floor_of_a_square_well_sees_its_opening(gl_context):
    """Form factor of two squares of side 2 at distance 2: 0.1998 (Howell, Siegel and Mengüç 2010, C-11)."""
    walls = [
        quad((-1, 0, -1), (2, 0, 0), (0, 2, 0)),
        quad((-1, 0, 1), (0, 2, 0), (2, 0, 0)),
        quad((-1, 0, -1), (0, 2, 0), (0, 0, 2)),
        quad((1, 0, -1), (0, 0, 2), (0, 2, 0)),
    ]
    scene = under_sky([quad((-1, 0, -1), (0, 0, 2), (2, 0, 0)), *walls])
    got = direct_over_radiance(gl_context, scene, view_from((0.0, 3.9, 0.001)), 64)
    assert got.mean() == pytest.approx(0.1998 * np.pi, rel=0.02)


def test_the_sky_is_seen_where_nothing_else_is(gl_context):
    """Each texel where it should be: the row and column of the direction that a pixel looks along."""
    rng = np.random.default_rng(5)
    radiance = rng.random((8, 16, 3)).astype(np.float32)
    far_below = scene_of([quad((0, -50, 0), (1, 0, 0), (0, 0, 1))], [(0.5,) * 3])
    scene = replace(far_below, environment=Environment(radiance))
    runtime = Runtime(scene, context=gl_context)
    directions = texel_directions(8, 16)
    for row, column in ((0, 3), (2, 0), (3, 5), (5, 11), (4, 15)):
        target = directions[row, column]
        view = View("up", "fitted", (3, 3), Camera(look_at([0.0, 0.0, 0.0], target.tolist()), 0.02), ())
        image = runtime.render(view, config_of(4), layer="direct")
        np.testing.assert_allclose(image[1, 1], radiance[row, column], rtol=1e-6)


@pytest.mark.parametrize(("side_of_frame", "mean_error", "error"), [(96, 0.03, 0.15), (288, 0.01, 0.05)])
def test_light_through_a_window_is_as_soft_as_the_sky_is_wide(gl_context, side_of_frame, mean_error, error):
    """On the floor of a room of 4 × 2 × 4 with one window: the irradiance of the window's rectangle.

    Small frames have 1,024 rays for two by two pixels, of which a place sees tens. In large ones tiles find
    out where the window is, and half of all rays go there: 0.033, where rays that do not know have 0.124.
    """
    scene = room("window", (side_of_frame, side_of_frame), (0.8, 1.6), 0.5)
    frame = Runtime(scene.scene, context=gl_context).capture(scene.view, config_of(32), maps=False)
    floor = scene.floor(frame)
    expected = scene.exact(frame.position_world[floor])
    got = frame.direct_irradiance[floor][:, 0] / RADIANCE[0]
    assert floor.sum() > 2000
    assert got.mean() == pytest.approx(expected.mean(), rel=mean_error)
    assert np.sqrt(((got - expected) ** 2).mean()) < error * expected.mean()


def test_under_a_table_it_is_dark_by_what_the_table_hides(gl_context):
    """A square of side 2 at height 1 over open ground: π less its form factor. Pointwise 1 % of the mean."""
    scene = table((96, 96))
    frame = Runtime(scene.scene, context=gl_context).capture(scene.view, config_of(32), maps=False)
    floor = scene.floor(frame)
    expected = scene.exact(frame.position_world[floor])
    got = frame.direct_irradiance[floor][:, 0] / RADIANCE[0]
    assert got.mean() == pytest.approx(expected.mean(), rel=0.015)
    assert np.sqrt(((got - expected) ** 2).mean()) < 0.01 * expected.mean()


@pytest.mark.parametrize(("half_angle", "elevation"), [(0.03, 90), (0.08, 45), (0.12, 10), (0.3, 10)])
def test_a_bright_patch_in_a_black_sky_has_all_of_its_light(gl_context, half_angle, elevation):
    """A disc of a few texels: every pixel of open ground gets it, to 1 %."""
    directions = texel_directions(128, 256)
    up = np.radians(elevation)
    lit = directions @ np.array([0.0, np.sin(up), -np.cos(up)]) > np.cos(half_angle)
    radiance = np.where(lit, 10.0, 0.0)[..., None] * np.ones(3)
    power = radiance[..., 0] * solid_angles(128, 256)[:, None]
    expected = (power * np.maximum(directions[..., 1], 0.0)).sum()
    ground = scene_of([quad((-10, 0, -10), (0, 0, 20), (20, 0, 0))], [(0.5,) * 3])
    scene = replace(ground, environment=Environment(radiance.astype(np.float32)))
    frame = Runtime(scene, context=gl_context).capture(view_from((0.0, 3.0, 0.01)), config_of(32), maps=False)
    np.testing.assert_allclose(frame.direct_irradiance[frame.valid], expected, rtol=1e-2)


@pytest.mark.parametrize("lights", [1, 3, 256])
def test_few_and_many_lights_are_of_one_sky(gl_context, lights):
    """Open ground, to 2 %: direct light does not depend on how many lights stand for a sky."""
    scene = under_sky([quad((-10, 0, -10), (0, 0, 20), (20, 0, 0))])
    got = direct_over_radiance(gl_context, scene, view_from((0.0, 3.0, 0.01)), lights)
    np.testing.assert_allclose(got, np.pi, rtol=0.02)


@pytest.mark.parametrize("size", [(48, 48), (280, 240)])
def test_a_red_patch_in_a_blue_sky_shines_on_pixels_without_a_ray_to_it(gl_context, size):
    """Some ten rays of 1,024 go to the patch, and a pixel of a large frame takes sixteen. Open ground gets
    all of the sky in every channel: to 1 %, for the resampling of the map."""
    directions = texel_directions(64, 128)
    radiance = np.where(directions[..., 1:2] > np.cos(0.25), [1.0, 0.0, 0.0], [0.0, 0.3, 1.0])
    environment = Environment(radiance.astype(np.float32))
    scene = replace(under_sky([quad((-10, 0, -10), (0, 0, 20), (20, 0, 0))]), environment=environment)
    view = replace(view_from((0.0, 3.0, 0.01)), size=size)
    frame = Runtime(scene, context=gl_context).capture(view, config_of(32), maps=False)
    facing = np.maximum(directions[..., 1], 0.0) * solid_angles(64, 128)[:, None]
    expected = np.einsum("hwc,hw->c", environment.radiance.astype(np.float64), facing)
    np.testing.assert_allclose(frame.direct_irradiance[frame.valid].mean(axis=0), expected, rtol=0.01)


def test_rays_start_below_what_stands_low_on_a_large_ground(gl_context):
    """A plate of 2 × 2 m, 5 cm over the middle of 6 × 6 km. What reaches the floor half a metre within its
    edge comes from the sides alone: a tenth of the open sky's at most. Rays that began above it had all."""
    ground = quad((-3000, 0, -3000), (0, 0, 6000), (6000, 0, 0))
    plate = quad((-1, 0.05, -1), (2, 0, 0), (0, 0, 2))
    view = replace(view_from((0.0, 0.03, 0.6), (0.0, 0.0, -0.1), 0.8), size=(96, 96))
    frame = Runtime(under_sky([ground, plate]), context=gl_context).capture(view, config_of(32), maps=False)
    place = frame.position_world
    below = frame.valid & (place[..., 1] < 0.01) & (np.abs(place[..., [0, 2]]) < 0.5).all(axis=-1)
    assert below.sum() > 400
    assert frame.direct_irradiance[below][:, 0].mean() / RADIANCE[0] < 0.1 * np.pi


@pytest.mark.parametrize("seed", [0, 1])
def test_rays_and_narrow_lights_have_all_of_the_light(seed):
    """Narrow lights and rays add up to the flux of the whole map, to the rounding of float32."""
    rng = np.random.default_rng(seed)
    radiance = rng.random((64, 128, 3)).astype(np.float32)
    radiance[16, 30] += 1e5 * (seed == 1)
    sky = sky_lights(Environment(radiance), 24)
    assert sky.narrow == (seed == 1)
    flux = (radiance * solid_angles(64, 128)[:, None, None]).sum(axis=(0, 1))
    narrow = sum((light.intensity for light in sky.lights[: sky.narrow]), np.zeros(3))
    np.testing.assert_allclose(sky.ray_flux.sum(axis=0) + narrow, flux, rtol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(sky.ray_towards, axis=1), 1.0, rtol=1e-6)
    # Each ray's light is that of its texels, which lie around it.
    owner = np.repeat(np.arange(len(sky.ray_flux)), sky.ray_texels[:, 1])
    np.testing.assert_array_equal(
        sky.ray_texels[:, 0], np.cumsum(sky.ray_texels[:, 1]) - sky.ray_texels[:, 1]
    )
    for channel in range(3):
        of_texels = np.bincount(owner, sky.texel_flux[:, channel])
        np.testing.assert_allclose(of_texels, sky.ray_flux[:, channel], rtol=1e-5)
    assert (sky.texel_towards * sky.ray_towards[owner]).sum(axis=1).min() > 0.7


def test_an_even_sky_is_even_for_every_orientation():
    """With 32 lights: within 6 % for surfaces of 500 orientations, where a surface's horizon may run through
    a light's part of the sky, and within 2 % along the axes, for which the lights are weighted."""
    lights = sky_lights(even_sky(RADIANCE), 32).lights
    towards = np.stack([-light.direction_world for light in lights])
    power = np.array([light.intensity[0] for light in lights])
    normals = np.random.default_rng(1).normal(size=(500, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    got = np.maximum(normals @ towards.T, 0.0) @ power / (np.pi * RADIANCE[0])
    np.testing.assert_allclose(got, 1.0, atol=0.06)
    axes = np.maximum(np.concatenate([np.eye(3), -np.eye(3)]) @ towards.T, 0.0) @ power
    np.testing.assert_allclose(axes / (np.pi * RADIANCE[0]), 1.0, atol=0.02)


def test_a_sun_in_the_map_is_one_light_of_its_flux():
    radiance = np.full((32, 64, 3), 1e-3, np.float32)
    radiance[6, 20] = 1e4
    lights = sky_lights(Environment(radiance), 16).lights
    sun = max(lights, key=lambda light: light.intensity.mean())
    flux = 1e4 * solid_angles(32, 64)[6]
    assert sun.intensity.mean() == pytest.approx(flux, rel=0.02)
    angle = np.arccos(np.clip(-sun.direction_world @ texel_directions(32, 64)[6, 20], -1.0, 1.0))
    assert angle < np.radians(3.0)


@pytest.mark.parametrize("count", [1, 2, 7, 256])
def test_never_more_lights_than_asked_for(count):
    assert 1 <= len(sky_lights(even_sky(RADIANCE), count).lights) <= count
    dark = sky_lights(even_sky((0.0, 0.0, 0.0)), count)
    assert (dark.lights, dark.narrow, len(dark.ray_flux)) == ((), 0, 0)
