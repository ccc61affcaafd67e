"""Scenes built in code that move."""

import dataclasses

import numpy as np
from built_scenes import colored_room

from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.scene_animation import Animation, Channel, Skin, Skinning


def bent_board(seconds_per_turn=4.0) -> Scene:
    """The room with its board on two joints, one of which turns about z; both pull on every vertex."""
    room = colored_room()
    (board_index,) = [i for i, mesh in enumerate(room.meshes) if mesh.name == "board"]
    board = room.meshes[board_index]
    weights = np.array([[1.0, 0.0], [0.25, 0.75], [0.0, 1.0], [0.6, 0.4]], np.float32)
    skinning = Skinning(
        board.positions, board.normals, np.tile(np.array([[0, 1]], np.int32), (4, 1)), weights
    )
    times = np.linspace(0.0, seconds_per_turn, 9)
    halves = np.linspace(0.0, np.pi, 9)
    keys = np.stack([0 * halves, 0 * halves, np.sin(halves), np.cos(halves)], axis=1)
    count = len(room.instances)
    is_board = np.arange(count) == board_index
    animation = Animation(
        parents=np.array([-1, 0], np.int32),
        rest_local=np.tile(np.eye(4), (2, 1, 1)),
        rest_translation=np.zeros((2, 3)),
        rest_rotation=np.tile([0.0, 0.0, 0.0, 1.0], (2, 1)),
        rest_scale=np.ones((2, 3)),
        channels=(Channel(1, "rotation", "linear", times, keys, None, seconds_per_turn),),
        instance_nodes=np.full(count, -1, np.int32),
        instance_local=np.tile(np.eye(4), (count, 1, 1)),
        instance_skins=np.where(is_board, 0, -1).astype(np.int32),
        light_nodes=np.zeros(0, np.int32),
        camera_nodes=np.zeros(0, np.int32),
        skins=(Skin(np.array([0, 1], np.int32), np.tile(np.eye(4), (2, 1, 1))),),
        root_to_world=np.eye(4),
    )
    meshes = list(room.meshes)
    meshes[board_index] = dataclasses.replace(board, skinning=skinning)
    return dataclasses.replace(room, meshes=tuple(meshes), animation=animation)
