"""The parts of a scene that move as one: an instance, or of a skinned mesh the triangles of one joint.

Each triangle of a skinned mesh goes with the joint that weighs most in it. Seams between pieces may open or
overlap by what blending would have smoothed.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int64

from vpltune.renderer.scene.scene import Mesh, Scene


@dataclass(frozen=True, eq=False)
class RigidPiece:
    """Triangles of one instance that one matrix places."""

    mesh: int
    """Index into `Scene.meshes`."""
    triangles: Int64[np.ndarray, " triangles"]
    """Which of the mesh's triangles."""
    corners: Float32[np.ndarray, "triangles 3 3"]
    """In the space that the matrix maps to the world."""
    matrix_row: int
    """Among the transforms of all instances, then all joint matrices."""


def rigid_pieces(scene: Scene) -> Iterator[RigidPiece]:
    """The pieces of all instances that have triangles, instance by instance."""
    rows = first_matrix_rows(scene)
    for index, instance in enumerate(scene.instances):
        for joint, corners, own in pieces_of_mesh(scene.meshes[instance.mesh]):
            if len(own):
                yield RigidPiece(instance.mesh, own, corners, rows[index] + joint)


def first_matrix_rows(scene: Scene) -> list[int]:
    """For each instance, the row of its transform, or of the first joint matrix of its skin."""
    animation = scene.animation
    skins = () if animation is None else animation.skins
    first_joints = len(scene.instances) + np.cumsum([0] + [len(skin.joints) for skin in skins])
    return [
        index
        if animation is None or scene.meshes[instance.mesh].skinning is None
        else int(first_joints[animation.instance_skins[index]])
        for index, instance in enumerate(scene.instances)
    ]


def pieces_of_mesh(
    mesh: Mesh,
) -> list[tuple[int, Float32[np.ndarray, "triangles 3 3"], Int64[np.ndarray, " triangles"]]]:
    """For each piece of a mesh: its joint, 0 without a skin; its corners; and which triangles it has."""
    if mesh.skinning is None:
        return [(0, mesh.positions[mesh.triangles], np.arange(len(mesh.triangles)))]
    joints = mesh.skinning.joints[mesh.triangles].reshape(len(mesh.triangles), -1)
    weights = mesh.skinning.weights[mesh.triangles].reshape(len(mesh.triangles), -1)
    shares = ((joints[:, :, None] == joints[:, None, :]) * weights[:, None, :]).sum(axis=2)
    heaviest = np.take_along_axis(joints, shares.argmax(axis=1)[:, None], axis=1)[:, 0]
    corners = mesh.skinning.bind_positions[mesh.triangles]
    return [
        (int(joint), corners[heaviest == joint], np.flatnonzero(heaviest == joint))
        for joint in np.unique(heaviest)
    ]
