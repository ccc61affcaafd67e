"""Keyframe interpolation compared with closed forms (glTF 2.0 appendix C)."""

import dataclasses

import numpy as np
import pytest
from built_scenes import colored_room

from vpltune.renderer.scene.animation import AnimationPlayer, slerp
from vpltune.renderer.scene.scene_animation import Animation, Channel


def about(axis, angle):
    """The quaternion of a rotation about a unit axis."""
    return np.array([*(np.asarray(axis) * np.sin(angle / 2.0)), np.cos(angle / 2.0)])


def rotation_matrix(axis, angle):
    """The matrix of a rotation about a unit axis (Rodrigues 1840)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def moving_room(*channels, parents=(-1,), rest_translation=None):
    """The coloured room, with all instances attached to the last node."""
    scene = colored_room()
    count, instances = len(parents), len(scene.instances)
    translation = np.zeros((count, 3)) if rest_translation is None else np.array(rest_translation, np.float64)
    local = np.tile(np.eye(4), (count, 1, 1))
    local[:, :3, 3] = translation
    animation = Animation(
        parents=np.array(parents, np.int32),
        rest_local=local,
        rest_translation=translation,
        rest_rotation=np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)),
        rest_scale=np.ones((count, 3)),
        channels=channels,
        instance_nodes=np.full(instances, count - 1, np.int32),
        instance_local=np.tile(np.eye(4), (instances, 1, 1)),
        instance_skins=np.full(instances, -1, np.int32),
        light_nodes=np.zeros(0, np.int32),
        camera_nodes=np.zeros(0, np.int32),
        skins=(),
        root_to_world=np.eye(4),
    )
    return dataclasses.replace(scene, animation=animation)


def channel(animated, interpolation, times, values, node=0, tangents=None):
    return Channel(
        node,
        animated,
        interpolation,
        np.array(times, np.float64),
        np.array(values, np.float64),
        None if tangents is None else np.array(tangents, np.float64),
        float(times[-1]),
    )


def transform_at(scene, seconds):
    return AnimationPlayer(scene).pose_at(seconds).transforms[0]


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5, 0.9])
@pytest.mark.parametrize("angle", [1e-6, 0.3, 2.9, 4.0])
def test_slerp_turns_at_constant_speed_the_shorter_way(angle, share):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    scene = moving_room(channel("rotation", "linear", [0, 1], [about(axis, 0.0), about(axis, angle)]))
    shorter = angle if angle <= np.pi else angle - 2.0 * np.pi
    np.testing.assert_allclose(
        transform_at(scene, share)[:3, :3], rotation_matrix(axis, share * shorter), atol=1e-12
    )


def test_slerp_keeps_unit_length():
    random = np.random.default_rng(5)
    first, second = random.normal(size=(2, 1000, 4))
    turned = slerp(first, second, random.random((1000, 1)))
    # 1e-8: below the smallest arc, interpolation is linear.
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0, atol=1e-8)


def test_a_step_holds_until_the_next_key():
    scene = moving_room(channel("translation", "step", [0, 1, 2], [[0, 0, 0], [1, 0, 0], [2, 0, 0]]))
    assert [transform_at(scene, t)[0, 3] for t in (0.0, 0.999, 1.0, 1.999)] == [0, 0, 1, 1]


def test_a_cubic_spline_is_a_cubic():
    """A spline with the values and slopes of a cubic polynomial at its keys is that polynomial."""
    polynomial = np.polynomial.Polynomial([0.5, -2.0, 3.0, 1.5])
    slope = polynomial.deriv()
    times = np.array([0.0, 0.7, 2.0])
    values = np.zeros((3, 3))
    values[:, 1] = polynomial(times)
    tangents = np.zeros((3, 2, 3))
    tangents[:, :, 1] = slope(times)[:, None]
    scene = moving_room(channel("translation", "cubic_spline", times, values, tangents=tangents))
    for seconds in (0.0, 0.35, 0.7, 1.1, 1.9):
        np.testing.assert_allclose(transform_at(scene, seconds)[1, 3], polynomial(seconds), rtol=1e-12)


def test_a_cubic_rotation_is_normalised():
    axis = np.array([0.0, 0.0, 1.0])
    keys = [about(axis, 0.0), about(axis, 1.0)]
    scene = moving_room(channel("rotation", "cubic_spline", [0, 1], keys, tangents=np.zeros((2, 2, 4))))
    linear = transform_at(scene, 0.5)[:3, :3]
    np.testing.assert_allclose(linear @ linear.T, np.eye(3), atol=1e-12)
    # With zero tangents, the middle between two keys is half the rotation.
    np.testing.assert_allclose(linear, rotation_matrix(axis, 0.5), atol=1e-12)


def test_a_channel_holds_still_before_its_first_key_and_repeats():
    scene = moving_room(channel("translation", "linear", [1, 3], [[5, 0, 0], [9, 0, 0]]))
    assert [transform_at(scene, t)[0, 3] for t in (0.0, 0.5, 2.0, 3.0, 5.0)] == [5, 5, 7, 5, 7]


def test_a_clip_of_one_key_is_a_pose():
    scene = moving_room(channel("scale", "linear", [0], [[2, 3, 4]]))
    np.testing.assert_array_equal(transform_at(scene, 17.0), np.diag([2.0, 3.0, 4.0, 1.0]))


def test_the_hierarchy_is_a_product_of_matrices():
    """The end of an arm with two links is where trigonometry puts it."""
    z = [0.0, 0.0, 1.0]
    scene = moving_room(
        channel("rotation", "linear", [0, 1], [about(z, 0.0), about(z, 1.0)], node=0),
        channel("rotation", "linear", [0, 1], [about(z, 0.0), about(z, -2.0)], node=1),
        parents=(-1, 0, 1),
        rest_translation=[[0, 0, 0], [2, 0, 0], [1, 0, 0]],
    )
    for t in (0.0, 0.25, 0.75):
        expected = 2.0 * np.array([np.cos(t), np.sin(t)]) + np.array([np.cos(t - 2 * t), np.sin(t - 2 * t)])
        np.testing.assert_allclose(transform_at(scene, t)[:2, 3], expected, atol=1e-12)
