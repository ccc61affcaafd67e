"""Receiver bounds hold all that the camera sees, and visibility maps that follow them lose nothing."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import colored_room, quad, room_view, scene_of

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.drawn_frame import DrawnFrame
from vpltune.renderer.frame.passes import receiver_bounds
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.visibility_map_layout import FEW_LOOKED_UP
from vpltune.renderer.scene.scene import Camera, Light, Scene
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View
from vpltune.tuner.prior.scene_generator import generated_scene

QUALITY = Quality(interleave=1, rsm_resolution=128)
POINTS = TunedConfig(ArtistParameters(vpl_count=48, lloyd_iterations=0), quality=QUALITY, light=ONE_BOUNCE)
DISCS = replace(POINTS, parameters=replace(POINTS.parameters, lloyd_iterations=1))
INTERLEAVED = replace(DISCS, quality=replace(QUALITY, interleave=4))
SIZE = (50, 38)
"""No multiple of a tile."""


def drawn_both_ways(gl_context, monkeypatch, scene: Scene, view: View, config: TunedConfig):
    """The captured frame and statistics, with the boxes and without room for any."""
    found = []
    for room in (receiver_bounds.BOXES_OF_TILE, 0):
        monkeypatch.setattr(receiver_bounds, "BOXES_OF_TILE", room)
        drawn = Runtime(scene, context=gl_context).draw(view, config)
        found.append((drawn.capture(), drawn.read_statistics()))
    return found


def boxes_of(drawn: DrawnFrame) -> np.ndarray:
    """[boxes, 4, 3]: low and high of positions, then of normals."""
    content = drawn.frame.resources.read("receiver_bounds")
    count = np.frombuffer(content[:4], np.uint32)[0]
    return np.frombuffer(content[16:], np.float32).reshape(-1, 4, 4)[:count, :, :3]


def test_every_receiver_lies_in_a_box(gl_context):
    """With its normal, to 1e-4 of the scene: positions are computed anew in float64.

    Boxes that hold everything would say nothing: on average they are 0.74 wide in a room of 2, at most half.
    """
    drawn = Runtime(colored_room(), context=gl_context).draw(room_view("spot", SIZE), POINTS)
    captured = drawn.capture()
    tolerance = 1e-4 * np.ptp(captured.position_world[captured.valid], axis=0).max()
    position, normal = (
        array[captured.valid][:, None] for array in (captured.position_world, captured.normal_world)
    )
    low, high, normal_low, normal_high = np.moveaxis(boxes_of(drawn), 1, 0)
    assert len(position) > 0
    assert (high - low).max(axis=1).mean() < 1.0
    inside = (position >= low - tolerance) & (position <= high + tolerance)
    inside &= (normal >= normal_low - 1e-4) & (normal <= normal_high + 1e-4)
    assert inside.all(-1).any(1).all()


@pytest.mark.parametrize("config", [POINTS, DISCS, INTERLEAVED])
def test_images_are_the_same_to_the_last_bit(gl_context, monkeypatch, config):
    """As are the scene statistics, which read maps too."""
    (pruned, statistics), (whole, all_statistics) = drawn_both_ways(
        gl_context, monkeypatch, colored_room(), room_view("spot", SIZE), config
    )
    np.testing.assert_array_equal(pruned.vpl_irradiance, whole.vpl_irradiance)
    np.testing.assert_array_equal(statistics, all_statistics)
    assert (pruned.visibility_maps.block >= 0).any()


@pytest.mark.parametrize("number", [1, 3, 4])
def test_generated_scenes_lose_nothing(gl_context, monkeypatch, number):
    """A hall, a courtyard and two rooms: the same images, and what is cast is what would be cast without."""
    scene = generated_scene(number, seed=3)
    view = View("generated", "fitted", SIZE, scene.cameras[0], scene.lights)
    (pruned, _), (whole, _) = drawn_both_ways(gl_context, monkeypatch, scene, view, DISCS)
    np.testing.assert_array_equal(pruned.vpl_irradiance, whole.vpl_irradiance)
    maps, complete = pruned.visibility_maps, whole.visibility_maps
    both = (maps.block < 0) & (complete.block < 0)
    nothing = maps.distance.max()
    # The lowest bits of a distance mark corners with neighbours, which may not have been cast.
    same = np.isclose(maps.distance, complete.distance, rtol=2e-6) & (maps.normal == complete.normal).all(-1)
    assert (same | (maps.distance == nothing))[both].all()
    # Where few texels are looked up, all of them are finer.
    few = (maps.block >= 0).sum((1, 2), keepdims=True) <= FEW_LOOKED_UP
    assert (complete.block >= 0)[(maps.block >= 0) & ~few].all()
    assert same.mean() < 0.9


def test_vpls_that_nothing_visible_faces_cast_nothing(gl_context, monkeypatch):
    """The camera sees a lit floor alone, and the ceiling over it lies behind: no VPL lights what is seen."""
    floor, ceiling = (
        quad((-1, height, -1), (0, 0, 2), (2, 0, 0), 0, name)
        for height, name in ((0.0, "floor"), (2.0, "ceiling"))
    )
    scene = scene_of([floor, ceiling], [(0.7, 0.7, 0.7)])
    above = np.array([0.0, 1.0, 0.0])
    light = Light("spot", np.full(3, 4.0), above, np.array([0.0, -1.0, 0.0]), 0.3, 0.5)
    camera = Camera(look_at(above, np.array([0.0, 0.0, 0.01])), 0.5)
    view = View("floor", "fitted", SIZE, camera, (light,))
    (pruned, _), (whole, _) = drawn_both_ways(gl_context, monkeypatch, scene, view, POINTS)
    nothing = whole.visibility_maps.distance.max()
    assert (whole.visibility_maps.distance < nothing).any()
    assert (pruned.visibility_maps.distance == nothing).all()
    np.testing.assert_array_equal(pruned.vpl_irradiance, whole.vpl_irradiance)
