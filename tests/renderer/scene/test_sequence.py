"""Sequences: the scene's own cameras and lights follow its animation, and added motions are periodic."""

import dataclasses

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view

from vpltune.renderer.scene.scene import scaled
from vpltune.renderer.scene.scene_animation import Animation, Channel
from vpltune.renderer.scene.sequence import MOTION_SECONDS, Sequence
from vpltune.renderer.scene.views import View, scaled_view


def lit_room(moving: bool):
    """The room with its own light and camera, both attached to a node that slides along x if `moving`."""
    room = colored_room()
    view = room_view("spot")
    scene = dataclasses.replace(room, lights=(ROOM_LIGHTS["spot"],), cameras=(view.camera,))
    if not moving:
        return scene
    count = len(scene.instances)
    places = np.stack([ROOM_LIGHTS["spot"].position_world, view.camera.position_world])
    local = np.tile(np.eye(4), (3, 1, 1))
    local[1, :3, 3] = places[0]
    local[1, :3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]  # −Z shines down
    local[2] = view.camera.to_world
    animation = Animation(
        parents=np.array([-1, 0, 0], np.int32),
        rest_local=local,
        rest_translation=np.zeros((3, 3)),
        rest_rotation=np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)),
        rest_scale=np.ones((3, 3)),
        channels=(
            Channel(
                0,
                "translation",
                "linear",
                np.array([0.0, 2.0]),
                np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]]),
                None,
                2.0,
            ),
        ),
        instance_nodes=np.full(count, -1, np.int32),
        instance_local=np.tile(np.eye(4), (count, 1, 1)),
        instance_skins=np.full(count, -1, np.int32),
        light_nodes=np.array([1], np.int32),
        camera_nodes=np.array([2], np.int32),
        skins=(),
        root_to_world=np.eye(4),
    )
    return dataclasses.replace(scene, animation=animation)


def own_view(scene) -> View:
    return View("own", "fitted", (16, 12), scene.cameras[0], scene.lights)


def test_the_scenes_own_camera_and_light_follow_its_animation():
    scene = lit_room(moving=True)
    moment = Sequence(scene, own_view(scene)).at(0.5)
    shift = [0.1, 0.0, 0.0]
    (light,) = moment.view.lights
    np.testing.assert_allclose(light.position_world, scene.lights[0].position_world + shift, atol=1e-12)
    np.testing.assert_allclose(light.direction_world, scene.lights[0].direction_world, atol=1e-12)
    camera = moment.view.camera
    np.testing.assert_allclose(camera.position_world, scene.cameras[0].position_world + shift, atol=1e-12)
    np.testing.assert_allclose(camera.to_world[:3, :3], scene.cameras[0].to_world[:3, :3], atol=1e-12)


def test_a_camera_of_another_stands_still():
    scene = lit_room(moving=True)
    view = room_view("point")
    moment = Sequence(scene, view).at(0.5)
    np.testing.assert_array_equal(moment.view.camera.to_world, view.camera.to_world)
    np.testing.assert_array_equal(moment.view.lights[0].position_world, view.lights[0].position_world)


@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_motions_come_round(light):
    """A motion ends where it starts and moves in between. It moves points and turns other lights."""
    scene, view = lit_room(moving=False), room_view(light)
    sequence = Sequence(scene, view)
    for seconds in (0.0, MOTION_SECONDS):
        moment = sequence.at(seconds)
        np.testing.assert_allclose(moment.view.camera.to_world, view.camera.to_world, atol=1e-12)
        for name in ("position_world", "direction_world"):
            np.testing.assert_allclose(
                getattr(moment.view.lights[0], name), getattr(view.lights[0], name), atol=1e-12
            )
    away = sequence.at(0.3 * MOTION_SECONDS).view
    assert np.abs(away.camera.to_world - view.camera.to_world).max() > 0.05
    np.testing.assert_allclose(np.linalg.norm(away.lights[0].direction_world), 1.0)
    moved = np.abs(away.lights[0].position_world - view.lights[0].position_world).max()
    turned = np.abs(away.lights[0].direction_world - view.lights[0].direction_world).max()
    assert (moved > 0.01) == (light == "point")
    assert (turned > 0.1) == (light != "point")


@pytest.mark.parametrize(
    ("motion", "moves_light", "moves_camera"),
    [("none", False, False), ("light", True, False), ("camera", False, True), ("both", True, True)],
)
def test_motion_moves_what_it_names(motion, moves_light, moves_camera):
    view = room_view("spot")
    away = Sequence(lit_room(moving=False), view, motion).at(1.0).view
    assert (np.abs(away.camera.to_world - view.camera.to_world).max() > 0.0) == moves_camera
    light, start = away.lights[0], view.lights[0]
    assert (np.abs(light.direction_world - start.direction_world).max() > 0.0) == moves_light


def test_auto_adds_nothing_to_an_animation():
    scene = lit_room(moving=True)
    view = room_view("spot")
    np.testing.assert_array_equal(
        Sequence(scene, view, "auto").at(1.0).view.camera.to_world, view.camera.to_world
    )


def test_moments_of_a_larger_scene():
    """The moments of a scene scaled by 10 are its own moments scaled by 10."""
    scene = lit_room(moving=True)
    grown = Sequence(scene, own_view(scene), "both", factor=10.0).at(0.7)
    plain = Sequence(scene, own_view(scene), "both").at(0.7)
    expected = scaled_view(plain.view, 10.0)
    np.testing.assert_allclose(grown.view.camera.to_world, expected.camera.to_world, atol=1e-12)
    np.testing.assert_allclose(grown.view.lights[0].position_world, expected.lights[0].position_world)
    rest = np.array([instance.to_world for instance in scaled(scene, 10.0).instances])
    np.testing.assert_allclose(grown.pose.transforms, rest)
