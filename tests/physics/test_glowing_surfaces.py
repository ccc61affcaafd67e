"""Light that surfaces emit: closed forms, sides, textures, instances that move, and scale."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import quad, scene_of

from benchmarks.harness.polygon_irradiance import polygon_irradiance
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import LightSettings
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.capture import CapturedFrame
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.animation import Pose
from vpltune.renderer.scene.scene import Camera, Scene, Texture, scaled
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View, scaled_view

RADIANCE = np.array([3.0, 2.0, 1.0])
# Discs in place of a rectangle: 256 VPLs leave 128 of them on the panel.
CONFIG = TunedConfig(
    ArtistParameters(vpl_count=256),
    quality=Quality(interleave=1, map_size=16, rsm_resolution=64),
    light=LightSettings(1),
)
# The mean over the floor. No pixel is further off than POINTWISE: discs miss the corners of a rectangle.
MEAN, POINTWISE = 0.02, 0.12
ABOVE = View("above", "fitted", (24, 24), Camera(look_at([0.0, 3.5, 0.01], [0.0, 0.0, 0.0]), 0.5), ())


def panel_over_floor(
    corner=(-0.5, 1.0, -0.4), edge_u=(1.0, 0.0, 0.0), edge_v=(0.0, 0.0, 0.8), **glow
) -> Scene:
    """A black panel that faces a floor of 4 × 4 from a height of 1, and glows by `glow`."""
    floor = quad((-2, 0, -2), (0, 0, 4), (4, 0, 0), 0, "floor")
    made = scene_of([floor, quad(corner, edge_u, edge_v, 1, "panel")], [(0.5,) * 3, (0.0,) * 3])
    lamp = replace(made.materials[1], emission=tuple(map(float, RADIANCE)), **glow)
    return replace(made, materials=(made.materials[0], lamp))


def drawn(gl_context, scene: Scene, view: View = ABOVE, config: TunedConfig = CONFIG) -> CapturedFrame:
    return Runtime(scene, context=gl_context).capture(view, config, maps=False)


def on_floor(frame: CapturedFrame, scale: float = 1.0) -> np.ndarray:
    return frame.valid & (frame.position_world[..., 1] < 1e-3 * scale)


def corners_of(scene: Scene) -> np.ndarray:
    return scene.meshes[1].positions.astype(np.float64)


def test_a_panel_lights_the_floor_as_lambert_says(gl_context):
    scene = panel_over_floor()
    # From the side: the panel hides nothing of the floor below it.
    view = replace(ABOVE, camera=Camera(look_at([0.0, 0.9, 2.6], [0.0, 0.0, 0.0]), 0.6))
    frame = drawn(gl_context, scene, view)
    floor = on_floor(frame)
    expected = polygon_irradiance(corners_of(scene), frame.position_world[floor], np.array([0.0, 1.0, 0.0]))
    got = frame.direct_irradiance[floor] / RADIANCE
    assert floor.sum() > 300
    assert got.mean() == pytest.approx(expected.mean(), rel=MEAN)
    np.testing.assert_allclose(got, np.repeat(expected[:, None], 3, axis=1), rtol=POINTWISE)
    # The black panel sends nothing back, and its own light is no reflected light.
    assert frame.indirect_irradiance[floor].max() == 0.0


def test_a_panel_beside_the_floor_is_cut_at_the_horizon(gl_context):
    scene = panel_over_floor((-1.0, -0.5, -1.0), (2.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    view = replace(ABOVE, camera=Camera(look_at([0.0, 2.5, 2.6], [0.0, 0.0, 0.2]), 0.6))
    frame = drawn(gl_context, scene, view)
    front = on_floor(frame) & (frame.position_world[..., 2] > -0.8)
    corners = corners_of(scene)
    corners[:, 1] = np.maximum(corners[:, 1], 0.0)
    expected = polygon_irradiance(corners, frame.position_world[front], np.array([0.0, 1.0, 0.0]))
    got = (frame.direct_irradiance[front] / RADIANCE).mean()
    assert got == pytest.approx(expected.mean(), rel=0.03)


def test_the_front_alone_emits_unless_both_sides_do(gl_context):
    """The panel turned away lights the floor only if it emits both ways, and then as the other."""
    away = {"corner": (-0.5, 1.0, -0.4), "edge_u": (0.0, 0.0, 0.8), "edge_v": (1.0, 0.0, 0.0)}

    def level(**options) -> float:
        frame = drawn(gl_context, panel_over_floor(**options))
        return float(frame.direct_irradiance[on_floor(frame)].mean())

    front, both, both_away = (
        level(**options) for options in ({}, {"emits_both_ways": True}, {"emits_both_ways": True, **away})
    )
    assert level(**away) == 0.0 < front
    assert both == pytest.approx(front, rel=MEAN) and both_away == pytest.approx(front, rel=MEAN)


def test_a_texture_is_a_factor(gl_context):
    """A panel that is black on one half lights the floor as the other half alone."""
    texels = np.zeros((2, 64, 3), np.uint8)
    texels[:, :32] = 255
    made = panel_over_floor(emission_texture=0)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    meshes = (made.meshes[0], replace(made.meshes[1], uv=uv))
    texture = Texture("half", texels, "clamp_to_edge", "clamp_to_edge")
    scene = replace(made, meshes=meshes, textures=(texture,))
    half = panel_over_floor(edge_u=(0.5, 0.0, 0.0))
    got, expected = (drawn(gl_context, each) for each in (scene, half))
    floor = on_floor(got) & on_floor(expected)
    np.testing.assert_allclose(
        got.direct_irradiance[floor].mean(axis=0), expected.direct_irradiance[floor].mean(axis=0), rtol=MEAN
    )


def test_a_lamp_that_moves_takes_its_light_along(gl_context):
    """Bitwise as a scene where it stands there."""
    scene = panel_over_floor()
    to_world = np.eye(4)
    to_world[:3, 3] = [0.5, -0.3, 0.2]
    runtime = Runtime(scene, context=gl_context)
    runtime.pose(Pose(np.stack([np.eye(4), to_world]), np.zeros((0, 4, 4)), (), ()))
    moved = runtime.capture(ABOVE, CONFIG, maps=False)
    instances = (scene.instances[0], replace(scene.instances[1], to_world=to_world))
    there = drawn(gl_context, replace(scene, instances=instances))
    np.testing.assert_array_equal(moved.direct_irradiance, there.direct_irradiance)
    assert not np.array_equal(moved.direct_irradiance, drawn(gl_context, scene).direct_irradiance)


def test_emission_is_seen_and_is_direct_light(gl_context):
    scene = panel_over_floor()
    below = replace(ABOVE, camera=Camera(look_at([0.0, 0.2, 0.01], [0.0, 1.0, 0.0]), 0.3))
    runtime = Runtime(scene, context=gl_context)
    for layer, expected in (("direct", RADIANCE), ("indirect", np.zeros(3))):
        image = runtime.render(below, CONFIG, layer=layer)
        np.testing.assert_allclose(image, np.broadcast_to(expected, image.shape), rtol=1e-6)
    from_behind = runtime.render(ABOVE, CONFIG, layer="direct")[10:14, 10:14]
    assert from_behind.max() == 0.0


@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_scale_changes_nothing(gl_context, factor):
    """To float32's rounding: discs follow from distances in units of L."""
    scene = panel_over_floor()
    plain = drawn(gl_context, scene)
    other = drawn(gl_context, scaled(scene, factor), scaled_view(ABOVE, factor))
    floor = on_floor(plain) & on_floor(other, factor)
    np.testing.assert_allclose(other.direct_irradiance[floor], plain.direct_irradiance[floor], rtol=5e-3)


def test_frames_repeat_bitwise(gl_context):
    scene = panel_over_floor()
    config = replace(CONFIG, light=LightSettings("all"))
    first, second = (drawn(gl_context, scene, config=config) for _ in range(2))
    np.testing.assert_array_equal(first.direct_irradiance, second.direct_irradiance)
    np.testing.assert_array_equal(first.indirect_irradiance, second.indirect_irradiance)
