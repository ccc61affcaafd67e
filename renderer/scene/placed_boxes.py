"""Bounds of a moving scene from boxes that move with its instances and joints, instead of all vertices."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from vpltune.renderer.scene.scene import Scene

# The corners of a box: which of its two bounds each takes along each axis.
_CORNERS = np.array([[(corner >> axis) & 1 for axis in range(3)] for corner in range(8)])


@dataclass(frozen=True, eq=False)
class PlacedBoxes:
    """Boxes in the local space of an instance or joint, each with the index of the matrix that places it."""

    corners: Float64[np.ndarray, "boxes 8 3"]
    matrices: Int64[np.ndarray, " boxes"]
    """Index into the transforms of all instances, followed by all joint matrices."""

    def bounds(
        self,
        transforms: Float64[np.ndarray, "instances 4 4"],
        joint_matrices: Float64[np.ndarray, "joints 4 4"],
    ) -> Float64[np.ndarray, "2 3"]:
        """Low and high corner of an axis-aligned box around all boxes, world units."""
        to_world = np.concatenate([transforms, joint_matrices])[self.matrices]
        placed = self.corners @ to_world[:, :3, :3].transpose(0, 2, 1) + to_world[:, None, :3, 3]
        return np.stack([placed.min(axis=(0, 1)), placed.max(axis=(0, 1))])


def placed_boxes(scene: Scene) -> PlacedBoxes:
    """One box for each instance, or for a skinned instance one for each joint, around the vertices it moves.

    Linear blend skinning puts a vertex between the positions that each of its joints alone would give it. A
    box around the joints' boxes therefore contains it.
    """
    animation = scene.animation
    skins = () if animation is None else animation.skins
    first_joints = len(scene.instances) + np.cumsum([0] + [len(skin.joints) for skin in skins])
    boxes: list[np.ndarray] = []
    matrices: list[int] = []
    for index, instance in enumerate(scene.instances):
        mesh = scene.meshes[instance.mesh]
        if mesh.skinning is None or animation is None:
            boxes.append(_box(mesh.positions))
            matrices.append(index)
            continue
        first = int(first_joints[animation.instance_skins[index]])
        weighted = np.where(mesh.skinning.weights > 0.0, mesh.skinning.joints, -1)
        for joint in np.unique(weighted[weighted >= 0]):
            boxes.append(_box(mesh.skinning.bind_positions[(weighted == joint).any(axis=1)]))
            matrices.append(first + int(joint))
    corners = np.array(boxes)[:, _CORNERS, np.arange(3)]
    return PlacedBoxes(corners, np.array(matrices, np.int64))


def _box(points: np.ndarray) -> Float64[np.ndarray, "2 3"]:
    return np.stack([points.min(axis=0), points.max(axis=0)]).astype(np.float64)
