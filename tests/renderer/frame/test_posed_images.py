"""Moved scenes on the GPU are the same as scenes built where the motion has brought them."""

import dataclasses

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view
from moving_scenes import bent_board
from point_vpls import point_vpls

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.animation import AnimationPlayer
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.scene import Camera, Instance, Mesh
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View

# Visibility maps see a skin as rigid pieces, see renderer/gpu/ray_hierarchy.py.
WITHOUT_MAPS = TunedConfig(point_vpls(vpl_count=256), visibility="transmittance", light=ONE_BOUNCE)
# As points: which disc a sample goes to may hang on its last digit.
MAPS = WITHOUT_MAPS.seen_by("maps")
BUFFERS = ("position_world", "normal_world", "direct_irradiance", "indirect_irradiance")


def compare(captured, expected):
    """Tolerance 1e-5 of the largest: the same products in another order, in float32."""
    np.testing.assert_array_equal(captured.valid, expected.valid)
    for name in BUFFERS:
        value, reference = getattr(captured, name), getattr(expected, name)
        np.testing.assert_allclose(value, reference, atol=1e-5 * np.abs(reference).max(), err_msg=name)


def test_set_pose_is_a_scene_built_there(gl_context):
    scene = colored_room()
    random = np.random.default_rng(3)
    transforms = np.array([instance.to_world for instance in scene.instances])
    transforms[-1, :3, 3] = random.uniform(-0.2, 0.2, 3)
    transforms[-1, :3, :3] = np.diag([-1.0, 1.3, 0.8])
    built = dataclasses.replace(
        scene,
        instances=tuple(
            Instance(instance.name, instance.mesh, transforms[index])
            for index, instance in enumerate(scene.instances)
        ),
    )
    runtime = Runtime(scene, context=gl_context)
    at_rest = runtime.capture(room_view(), MAPS)
    runtime.scene_buffers.set_pose(transforms, np.zeros((0, 4, 4)))
    moved = runtime.capture(room_view(), MAPS)
    compare(moved, Runtime(built, context=gl_context).capture(room_view(), MAPS))
    assert np.abs(moved.indirect_irradiance - at_rest.indirect_irradiance).max() > 1e-2


def blended_mesh(mesh: Mesh, joint_matrices) -> Mesh:
    """Linear blend skinning in numpy, in double precision."""
    skinning = mesh.skinning
    blended = np.einsum("vk,vkij->vij", skinning.weights, joint_matrices[skinning.joints])
    positions = np.einsum("vij,vj->vi", blended[:, :3, :3], skinning.bind_positions) + blended[:, :3, 3]
    normals = np.einsum("vij,vj->vi", np.linalg.inv(blended[:, :3, :3]).transpose(0, 2, 1), mesh.normals)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return dataclasses.replace(
        mesh, positions=positions.astype(np.float32), normals=normals.astype(np.float32), skinning=None
    )


@pytest.mark.parametrize("light", ["spot", "point", "directional"])
def test_skins_bend_on_the_gpu_as_on_paper(gl_context, light):
    """Camera and light both see the bent board: depth and VPLs are those of the board bent in numpy."""
    scene = bent_board()
    runtime = Runtime(scene, context=gl_context)
    pose = AnimationPlayer(scene).pose_at(0.4)
    runtime.scene_buffers.set_pose(pose.transforms, pose.joint_matrices)
    baked = dataclasses.replace(
        scene,
        meshes=tuple(
            blended_mesh(mesh, pose.joint_matrices) if mesh.skinning is not None else mesh
            for mesh in scene.meshes
        ),
        animation=None,
    )
    view = room_view(light)
    bent, expected, still = (
        drawing.capture(view, WITHOUT_MAPS)
        for drawing in (runtime, *(Runtime(other, context=gl_context) for other in (baked, colored_room())))
    )
    changed = np.abs(bent.depth - still.depth) > 1e-3
    assert changed.mean() > 0.01, "the board did not move"
    # A silhouette may fall on the other side of a pixel's centre.
    same = np.abs(bent.depth - expected.depth) <= 1e-4 * expected.depth.max()
    assert same.mean() > 0.999
    for name in BUFFERS:
        value, reference = getattr(bent, name)[same], getattr(expected, name)[same]
        close = np.abs(value - reference) <= 1e-3 * np.abs(reference).max()
        assert close.mean() > 0.998, name


def test_bounds_follow_joints(gl_context):
    scene = bent_board()
    runtime = Runtime(scene, context=gl_context)
    player = AnimationPlayer(scene)
    board = next(mesh for mesh in scene.meshes if mesh.skinning is not None)
    for seconds in (0.0, 0.5, 1.3, 2.0):
        pose = player.pose_at(seconds)
        runtime.scene_buffers.set_pose(pose.transforms, pose.joint_matrices)
        low, high = runtime.scene_buffers.bounds()
        points = blended_mesh(board, pose.joint_matrices).positions
        assert (points >= low - 1e-6).all()
        assert (points <= high + 1e-6).all()


def test_skinned_corpus_at_rest_is_drawn_as_it_was_baked(corpora_folder, gl_context):
    """On the GPU's joints at rest, a skinned file gives the image of its vertices baked at rest."""
    folder = corpora_folder / "asset_generator" / "Output" / "Animation_Skin"
    compared = 0
    for path in sorted(folder.glob("*.gltf")):
        scene = read_scene(path)
        if scene.animation is None:
            continue
        baked = dataclasses.replace(
            scene,
            meshes=tuple(dataclasses.replace(mesh, skinning=None) for mesh in scene.meshes),
            animation=None,
        )
        low, high = baked.bounds()
        middle, reach = (low + high) / 2.0, np.linalg.norm(high - low)
        camera = Camera(look_at(middle + np.array([0.3, 0.2, 1.6]) * reach, middle), 0.8)
        view = View("skin", "fitted", (48, 48), camera, (ROOM_LIGHTS["directional"],))
        drawn, expected = (Runtime(s, context=gl_context).capture(view, WITHOUT_MAPS) for s in (scene, baked))
        assert expected.valid.any(), path.name
        assert (drawn.valid == expected.valid).mean() > 0.998, path.name
        both = drawn.valid & expected.valid
        np.testing.assert_allclose(
            drawn.position_world[both], expected.position_world[both], atol=1e-4 * reach, err_msg=path.name
        )
        compared += 1
    assert compared >= 4
