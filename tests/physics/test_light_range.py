"""Point and spot lights end at their range: direct light, VPLs, comparison modes, at any scale."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, quad, room_view, scene_of
from point_vpls import point_vpls

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError
from vpltune.renderer.export.glb_writer import write_glb
from vpltune.renderer.frame.capture import CapturedFrame
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.array_scene import scene_from_arrays
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.scene import Camera, Light, Scene, scaled
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View, checked_light, scaled_view
from vpltune.renderer.techniques.ray_traced_instant_radiosity import traced_vpls
from vpltune.renderer.techniques.vpls_readback import VplsReadback

CONFIG = TunedConfig(
    point_vpls(vpl_count=256),
    visibility="transmittance",
    quality=Quality(rsm_resolution=128),
    light=ONE_BOUNCE,
)
"""Points carry the flux of the RSM as it is; few of them, for only their sum is looked at."""
ROTATIONS = ((0.0, 0.0), (0.3, 0.7), (0.6, 0.1), (0.15, 0.45))


def share_left(distance: np.ndarray, reach: float) -> np.ndarray:
    """max(1 − (d/range)⁴, 0), KHR_lights_punctual, "Range Property"."""
    return np.maximum(1.0 - (distance / reach) ** 4, 0.0)


def wall_and_light(
    kind: str, distance: float, reach: float, cone: tuple[float, float] = (0.3, 0.6)
) -> tuple[Scene, View]:
    """A wall of 10 × 10 m at z = 0, with a spot or a point light `distance` in front of it.

    Of the point light's six faces one sees the wall.
    """
    wall = scene_of([quad((-5, -5, 0), (10, 0, 0), (0, 10, 0))], [(0.8, 0.6, 0.4)])
    light = Light(kind, np.full(3, 4.0), [0, 0, distance], [0, 0, -1], *cone, range=reach)
    camera = Camera(look_at([0.3, 0.2, 4.0], [0.05, 0.02, 0.0]), 0.9)
    return wall, View("wall", "fitted", (32, 24), camera, (light,))


def captured(gl_context, scene: Scene, view: View) -> CapturedFrame:
    return Runtime(scene, context=gl_context).capture(view, CONFIG)


@pytest.mark.parametrize("distance", [0.4, 0.9, 1.2, 1.45, 1.5, 2.0])
@pytest.mark.parametrize("kind", ["point", "spot"])
def test_direct_light_is_that_without_a_range_times_what_is_left(gl_context, kind, distance):
    """To 1e-4, and 2e-5 of the brightest pixel where little is left: positions are of single precision."""
    scene, view = wall_and_light(kind, distance, 1.5)
    ended = captured(gl_context, scene, view)
    endless = captured(gl_context, *wall_and_light(kind, distance, np.inf))
    (light,) = view.lights
    away = np.linalg.norm(ended.position_world - light.position_world, axis=-1, keepdims=True)
    assert endless.direct_irradiance.max() > 0.5
    expected = endless.direct_irradiance * share_left(away, 1.5)
    np.testing.assert_allclose(
        ended.direct_irradiance, expected, rtol=1e-4, atol=2e-5 * endless.direct_irradiance.max()
    )
    beyond = away[..., 0] > 1.5001
    assert (ended.direct_irradiance[beyond] == 0.0).all()
    assert (ended.direct_irradiance > 0.0).any() == (distance < 1.5)


@pytest.mark.parametrize("share", [0.5, 0.9, 0.99])
def test_the_flux_of_vpls_is_that_without_a_range_times_what_is_left(gl_context, share):
    """To 0.5 %, for a narrow spot, and its mean over the cone: the rim is 0.2 % farther than the middle,
    which at 0.99 ranges is a fifth of what is left there."""
    endless, ended = (
        captured(gl_context, *wall_and_light("spot", 1.5 * share, reach, (0.02, 0.06))).vpl_flux.sum(axis=0)
        for reach in (np.inf, 1.5)
    )
    cosine = np.linspace(np.cos(0.06), 1.0, 1000)
    cone = np.clip((cosine - np.cos(0.06)) / (np.cos(0.02) - np.cos(0.06)), 0.0, 1.0) ** 2
    left = (cone * share_left(1.5 * share / cosine, 1.5)).sum() / cone.sum()
    assert endless.min() > 0.0
    np.testing.assert_allclose(ended / endless, left, rtol=0.005)


def test_beyond_the_range_nothing_is_lit_and_no_vpl_shines(gl_context):
    scene, view = wall_and_light("point", 2.0, 1.5)
    frame = captured(gl_context, scene, view)
    assert (frame.vpl_flux == 0.0).all()
    assert (frame.direct_irradiance == 0.0).all()
    assert (frame.indirect_irradiance == 0.0).all()


@pytest.mark.parametrize("reach", [1.5, 2.5, None])
def test_a_lamp_of_a_file_ends_over_a_floor_that_is_farther_away(gl_context, tmp_path, reach):
    """A glTF lamp of 4 W/sr, 2 m over a floor of 10 × 10 m and beside a wall: E = 4 cos θ · left / d².

    To 1e-3, and 1e-4 W/m² where little is left: positions are of single precision.
    """
    ground = scene_of(
        [quad((-5, 0, -5), (0, 0, 10), (10, 0, 0)), quad((-2, 0, -2), (0, 2, 0), (0, 0, 4), 1)],
        [(0.7, 0.7, 0.7), (0.8, 0.2, 0.2)],
    )
    lamp = Light("point", 4.0, [0, 2, 0], range=reach or np.inf)
    camera = Camera(look_at([0.0, 4.0, 1e-4], [0.0, 0.0, 0.0]), 0.6)
    write_glb(tmp_path / "lamp.glb", replace(ground, lights=(lamp,), cameras=(camera,)))
    scene = read_scene(tmp_path / "lamp.glb")
    assert scene.warnings == ()
    camera, lights, _ = resolve_camera_and_lights(scene, tmp_path / "lamp.glb", None, None)
    frame = captured(gl_context, scene, View("file", "fitted", (32, 24), camera, lights))
    distance = np.linalg.norm(frame.position_world - [0.0, 2.0, 0.0], axis=-1)
    expected = 4.0 * 2.0 / distance**3 * share_left(distance, reach or np.inf)
    on_floor = frame.valid & (frame.position_world[..., 1] < 1e-3)
    assert on_floor.mean() > 0.9
    found = frame.direct_irradiance[on_floor]
    np.testing.assert_allclose(found, np.repeat(expected[on_floor, None], 3, 1), rtol=1e-3, atol=1e-4)
    assert (found == 0.0).all() == (reach == 1.5)
    assert np.isfinite(frame.indirect_irradiance).all()


@pytest.mark.parametrize("kind", ["spot", "wide_spot", "point"])
def test_a_range_grows_with_the_scene(gl_context, kind):
    """Images at 100 times the size: direct light to 1e-4 of its mean, as rounding differs; flux to 0.2 %,
    since 256 VPLs may fall on other texels."""
    scene, view = colored_room(), room_view(kind, (32, 24))
    light = replace(ROOM_LIGHTS[kind], range=1.6)
    view = replace(view, lights=(light,))
    small = captured(gl_context, scene, view)
    large = captured(gl_context, scaled(scene, 100.0), scaled_view(view, 100.0))
    plain = captured(gl_context, scene, room_view(kind, (32, 24)))
    assert small.direct_irradiance.sum() < 0.9 * plain.direct_irradiance.sum()
    difference = np.abs(small.direct_irradiance - large.direct_irradiance)
    # A pixel whose centre an edge passes may lie on either side.
    assert np.mean(difference > 1e-4 * small.direct_irradiance.mean()) < 5e-3
    np.testing.assert_allclose(small.vpl_flux.sum(axis=0) * 1e4, large.vpl_flux.sum(axis=0), rtol=2e-3)


@pytest.mark.parametrize("kind", ["spot", "point"])
def test_comparison_modes_end_at_the_range_too(gl_context, kind):
    """Total flux of traced rays and of VPLs read back against the RSM's: 5 %, as without a range."""
    light = replace(ROOM_LIGHTS[kind], range=1.6)
    view = replace(room_view(kind, (16, 12)), lights=(light,))
    config = replace(CONFIG, quality=Quality(rsm_resolution=256))
    runtime = Runtime(colored_room(), context=gl_context)
    frames = runtime.captures(view, config, ROTATIONS)
    expected = np.mean([frame.vpl_flux.sum(axis=0) for frame in frames], axis=0)
    drawn = runtime.draw(view, config)
    readback = VplsReadback(drawn.frame, 4096)
    read = readback.place(readback.read(), drawn.inputs.records)["flux"].sum(axis=0)
    traced = traced_vpls(colored_room(), (light,), 4096)["flux"].sum(axis=0)
    endless = traced_vpls(colored_room(), (replace(light, range=np.inf),), 4096)["flux"].sum(axis=0)
    assert (traced < 0.9 * endless).all()
    np.testing.assert_allclose(read, expected, rtol=0.05)
    np.testing.assert_allclose(traced, expected, rtol=0.05)


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_a_range_that_is_not_positive_is_no_light(value):
    with pytest.raises(ValueError, match="Light.range: must be positive"):
        Light("point", 1.0, range=value)


def test_a_range_too_short_to_be_scaled_is_refused_where_lights_are_checked():
    with pytest.raises(InputError, match=r"lamp\.range: must be positive, at least 1e-30, got 1e-310"):
        checked_light(Light("point", 1.0, range=1e-310), "lamp")


def test_lights_of_arrays_keep_their_range():
    light = Light("point", 1.0, [0, 1, 0], range=2.5)
    mesh = quad((-1, 0, -1), (0, 0, 2), (2, 0, 0))
    scene = scene_from_arrays(mesh.positions, mesh.triangles, lights=[light])
    assert scene.lights[0].range == 2.5
