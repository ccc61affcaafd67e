"""glTF animations: what is read, what moves, and what is left out with a warning."""

import re

import numpy as np
import pytest

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.animation import AnimationPlayer
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.scene import scaled
from vpltune.renderer.scene.transforms import transform_points

QUARTER_TURN_ABOUT_Z = [0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)]


def animate(gltf, path, times, values, interpolation=None, node=0, clip=None):
    """Add a channel to the document, in the clip given or in a new one; returns the clip."""
    if clip is None:
        clip = {"channels": [], "samplers": []}
        gltf.add("animations", clip)
    sampler = {
        "input": gltf.accessor(np.asarray(times, np.float32)),
        "output": values if isinstance(values, int) else gltf.accessor(np.asarray(values, np.float32)),
    }
    if interpolation is not None:
        sampler["interpolation"] = interpolation
    clip["samplers"].append(sampler)
    clip["channels"].append({"sampler": len(clip["samplers"]) - 1, "target": {"node": node, "path": path}})
    return clip


def placement(scene, seconds):
    return AnimationPlayer(scene).pose_at(seconds).transforms[0]


def test_a_channel_moves_its_node_and_all_below(triangle):
    triangle.document["nodes"] = [{"children": [1]}, {"mesh": 0, "translation": [0, 1, 0]}]
    animate(triangle, "translation", [0, 1, 2], [[0, 0, 0], [4, 0, 0], [0, 0, 8]])
    scene = read_scene(triangle.write())
    assert scene.warnings == ()
    assert scene.animation.duration == 2.0
    np.testing.assert_allclose(placement(scene, 0.5)[:3, 3], [2, 1, 0], atol=1e-12)
    np.testing.assert_allclose(placement(scene, 1.25)[:3, 3], [3, 1, 2], atol=1e-12)


def test_the_scene_itself_stays_at_rest(triangle):
    """The rest pose comes from the nodes, not from the keys at time 0."""
    triangle.node["translation"] = [7, 0, 0]
    animate(triangle, "translation", [0, 1], [[0, 0, 0], [4, 0, 0]])
    scene = read_scene(triangle.write())
    np.testing.assert_array_equal(scene.instances[0].to_world[:3, 3], [7, 0, 0])
    np.testing.assert_array_equal(AnimationPlayer(scene).rest_pose().transforms[0][:3, 3], [7, 0, 0])


def test_normalised_integers_are_rotations(triangle):
    stored = np.round(np.array([[0, 0, 0, 1], QUARTER_TURN_ABOUT_Z]) * 32767).astype(np.int16)
    animate(triangle, "rotation", [0, 1], triangle.accessor(stored, normalized=True))
    moved = transform_points(placement(read_scene(triangle.write()), 0.5), np.array([[1, 0, 0]], np.float32))
    # 1e-4: rounding of 16-bit quaternions.
    np.testing.assert_allclose(moved[0], [np.sqrt(0.5), np.sqrt(0.5), 0], atol=1e-4)


def test_gpu_instances_keep_their_place_on_a_moving_node(triangle):
    triangle.node["extensions"] = {
        "EXT_mesh_gpu_instancing": {
            "attributes": {"TRANSLATION": triangle.accessor(np.array([[1, 0, 0], [0, 2, 0]], np.float32))}
        }
    }
    animate(triangle, "rotation", [0, 1], [[0, 0, 0, 1], QUARTER_TURN_ABOUT_Z])
    transforms = AnimationPlayer(read_scene(triangle.write())).pose_at(0.99999999).transforms
    np.testing.assert_allclose(transforms[:, :3, 3], [[0, 1, 0], [-2, 0, 0]], atol=1e-6)


def test_clips_play_together_each_in_its_own_time(triangle):
    animate(triangle, "translation", [0, 2], [[0, 0, 0], [2, 0, 0]])
    animate(triangle, "scale", [0, 3], [[1, 1, 1], [4, 4, 4]])
    scene = read_scene(triangle.write())
    matrix = placement(scene, 2.5)  # 0.5 s into the second loop of one clip, 2.5 s into the other
    np.testing.assert_allclose(matrix, np.diag([3.5, 3.5, 3.5, 1]) + 0.5 * np.eye(4, k=3), atol=1e-12)
    assert scene.animation.duration == 3.0


def test_the_first_of_two_that_move_the_same_wins_aloud(triangle):
    animate(triangle, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
    animate(triangle, "translation", [0, 1], [[0, 0, 0], [0, 9, 0]])
    scene = read_scene(triangle.write())
    np.testing.assert_allclose(placement(scene, 0.5)[:3, 3], [0.5, 0, 0], atol=1e-12)
    assert scene.warnings == (
        "1 of 2 animation channels are left out: an earlier one animates the same property",
    )


def test_lights_and_cameras_ride_on_nodes(triangle):
    triangle.document["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "spot"}]}}
    triangle.document["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]
    triangle.document["nodes"] = [
        {"mesh": 0, "children": [1, 2]},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}, "translation": [1, 0, 0]},
        {"camera": 0, "translation": [0, 0, 5], "scale": [2, 2, 2]},
    ]
    half_turn_about_y = [0, 1, 0, 0]
    animate(triangle, "rotation", [0, 1, 2], [[0, 0, 0, 1], half_turn_about_y, [0, 0, 0, -1]])
    scene = read_scene(triangle.write())
    pose = AnimationPlayer(scene).pose_at(1.0)
    np.testing.assert_allclose(pose.lights[0].position_world, [-1, 0, 0], atol=1e-7)
    np.testing.assert_allclose(pose.lights[0].direction_world, [0, 0, 1], atol=1e-7)
    np.testing.assert_allclose(pose.cameras[0].position_world, [0, 0, -5], atol=1e-7)
    np.testing.assert_allclose(pose.cameras[0].to_world[:3, :3], np.diag([-1, 1, -1]), atol=1e-7)


def test_a_scaled_scene_moves_at_its_scale(triangle):
    animate(triangle, "translation", [0, 1], [[0, 0, 0], [4, 0, 0]])
    scene = read_scene(triangle.write())
    np.testing.assert_allclose(
        placement(scaled(scene, 10.0), 0.5), np.diag([10.0, 10.0, 10.0, 1.0]) @ placement(scene, 0.5)
    )


def test_what_moves_nothing_drawn_is_no_animation(triangle):
    triangle.add("nodes", {"name": "elsewhere"})
    animate(triangle, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]], node=1)
    scene = read_scene(triangle.write())
    assert scene.animation is None
    assert scene.warnings == ()


def test_morph_weights_are_left_out_aloud(triangle):
    animate(triangle, "weights", [0, 1], np.array([0.0, 1.0]))
    scene = read_scene(triangle.write())
    assert scene.animation is None
    assert scene.warnings == ("1 animation channel of morph weights or materials is ignored",)


@pytest.mark.parametrize(
    ("path", "times", "values", "interpolation", "cause"),
    [
        ("translation", [0, 0], [[0, 0, 0]] * 2, None, "times must rise strictly from at least 0"),
        ("translation", [-1, 0], [[0, 0, 0]] * 2, None, "times must rise strictly from at least 0"),
        ("translation", [0, np.nan], [[0, 0, 0]] * 2, None, "must be finite"),
        ("translation", [0, 1], [[0, 0, 0]] * 3, None, "must have 2 elements for 2 times, got 3"),
        ("translation", [0, 1], [[0, 0, 0]] * 2, "CUBICSPLINE", "must have 6 elements for 2 times"),
        ("translation", [0, 1], [[0, 0, 1e20]] * 2, None, "must be at most 1e.12 in magnitude"),
        (
            "translation",
            [0, 1],
            [[0, 0, 0]] * 2,
            "BEZIER",
            "must be one of STEP, LINEAR, CUBICSPLINE, got 'BEZIER'",
        ),
        ("rotation", [0, 1], [[0, 0, 0, 1], [0, 0, 0, 0]], None, "must be unit quaternions, got zero"),
        ("rotation", [0, 1], [[0, 0, 0]] * 2, None, "output must be VEC4, got 'VEC3'"),
        (
            "colour",
            [0, 1],
            [[0, 0, 0]] * 2,
            None,
            "must be one of translation, rotation, scale, got 'colour'",
        ),
    ],
)
def test_a_broken_channel_leaves_the_scene_at_rest(triangle, path, times, values, interpolation, cause):
    clip = animate(triangle, path, times, values, interpolation)
    animate(triangle, "scale", [0, 1], [[1, 1, 1], [3, 3, 3]], clip=clip)
    scene = read_scene(triangle.write())
    (warning,) = scene.warnings
    assert warning.startswith("1 of 2 animation channels are left out: ")
    assert re.search(cause, warning)
    np.testing.assert_allclose(placement(scene, 0.5), np.diag([2.0, 2.0, 2.0, 1.0]), atol=1e-12)


def test_a_node_with_a_matrix_is_not_animated(triangle):
    triangle.node["matrix"] = np.eye(4).ravel().tolist()
    animate(triangle, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
    scene = read_scene(triangle.write())
    assert scene.animation is None
    assert "must not have a matrix" in scene.warnings[0]


def test_a_motion_out_of_range_is_one_line(triangle):
    """Each scale is in range, but the product is not."""
    triangle.document["nodes"] = [{"children": [1]}, {"mesh": 0}]
    clip = animate(triangle, "scale", [0, 1], [[1, 1, 1], [1e11, 1, 1]])
    animate(triangle, "scale", [0, 1], [[1, 1, 1], [1e11, 1, 1]], node=1, clip=clip)
    scene = read_scene(triangle.write())
    with pytest.raises(InputError, match="its animation must stay within 1e\\+12, which it leaves at 0.5 s"):
        placement(scene, 0.5)


def test_the_animated_corpus_moves(corpora_folder):
    """Valid animations of the Khronos asset generator are read without warnings, and most move something.

    Their materials leave out metallicFactor, so they are metals.
    """
    paths = sorted((corpora_folder / "asset_generator" / "Output").glob("Animation_*/*.gltf"))
    assert paths
    still = []
    for path in paths:
        scene = read_scene(path)
        assert [line for line in scene.warnings if "metallic" not in line] == [], path.name
        if scene.animation is None:
            still.append(path.stem)
            continue
        player = AnimationPlayer(scene)
        poses = [player.pose_at(t) for t in np.linspace(0.0, scene.animation.duration, 9)]
        moved = np.ptp([pose.transforms for pose in poses], axis=0).max() > 0.0
        if len(poses[0].joint_matrices):
            moved |= np.ptp([pose.joint_matrices for pose in poses], axis=0).max() > 0.0
        if not moved:
            still.append(path.stem)
    # According to the corpus's README, these are skins without animation and an animation with a single key.
    assert still == [
        "Animation_NodeMisc_03", "Animation_Skin_00", "Animation_Skin_02", "Animation_Skin_03",
        "Animation_Skin_04", "Animation_Skin_07", "Animation_Skin_09",
    ]  # fmt: skip
