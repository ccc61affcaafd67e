"""glTF morph targets and skins, applied once to get the mesh at rest."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int32, Int64

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.gltf_accessors import Elements, GltfAccessors
from vpltune.renderer.scene.files.gltf_document import GltfDocument
from vpltune.renderer.scene.files.gltf_nodes import GltfNodes
from vpltune.renderer.scene.files.json_object import JsonObject
from vpltune.renderer.scene.files.surface import unit_rows


@dataclass(frozen=True, eq=False)
class Deformation:
    """The deformation of the mesh of a node."""

    weights: tuple[float, ...] = ()
    """Weights of the morph targets."""
    joint_to_world: Float64[np.ndarray, "joints 4 4"] | None = None
    """World matrix times inverse bind matrix of each joint; None without a skin."""
    is_animated: bool = False
    """Whether the joints move, so that the mesh must keep its bind pose."""


def read_deformation(
    node: JsonObject,
    mesh: JsonObject,
    document: GltfDocument,
    nodes: GltfNodes,
    accessors: GltfAccessors,
    moving_nodes: set[int],
) -> Deformation:
    """The morph weights of a node (its own, or else its mesh's) and the rest pose of its skin.

    Args:
        node: the node that shows the mesh.
        mesh: the mesh.
        document: the document of both.
        nodes: gives the joints' transforms to world.
        accessors: reads the inverse bind matrices.
        moving_nodes: indices of the animated nodes.

    Raises:
        SceneFileError: a reference is out of range, or counts do not match.
    """
    holder = node if "weights" in node.members else mesh
    count = len(holder.members["weights"]) if isinstance(holder.members.get("weights"), list) else 0
    weights = tuple(holder.numbers("weights", count, default=()).tolist())
    skin = document.referred(node, "skin", "skins")
    if skin is None:
        return Deformation(weights)
    joints, inverse_bind = read_skin(skin, nodes, accessors)
    to_world = np.stack([nodes.to_world(joint) for joint in joints]) @ inverse_bind
    return Deformation(weights, to_world, any(joint in moving_nodes for joint in joints))


def read_skin(
    skin: JsonObject, nodes: GltfNodes, accessors: GltfAccessors
) -> tuple[list[int], Float64[np.ndarray, "joints 4 4"]]:
    """The nodes of a skin's joints, and their inverse bind matrices.

    Raises:
        SceneFileError: there are no joints, one is out of range, or there are fewer matrices than joints.
    """
    joints = skin.indices("joints", len(nodes.nodes), "nodes")
    if not joints:
        raise SceneFileError(f"{skin.where}: must have at least one joint")
    if "inverseBindMatrices" not in skin.members:
        return joints, np.tile(np.eye(4), (len(joints), 1, 1))
    inverse_bind = accessors.referred(skin, "inverseBindMatrices", ("MAT4",))
    if len(inverse_bind) < len(joints):
        raise SceneFileError(
            f"{inverse_bind.where}: must have a matrix for each of {len(joints)} joints, "
            f"got {len(inverse_bind)}"
        )
    stored = inverse_bind.as_floats(np.arange(len(joints))).astype(np.float64)
    return joints, stored.reshape(-1, 4, 4).transpose(0, 2, 1)


def morphed(
    base: Float32[np.ndarray, "n 3"],
    semantic: str,
    primitive: JsonObject,
    weights: tuple[float, ...],
    accessors: GltfAccessors,
    used: Int64[np.ndarray, " n"],
    vertex_count: int,
) -> Float32[np.ndarray, "n 3"]:
    """`base` plus the weighted displacements of the primitive's morph targets.

    Args:
        base: positions or normals of the used vertices.
        semantic: "POSITION" or "NORMAL".
        primitive: has the targets.
        weights: one for each target.
        accessors: reads the displacements.
        used: indices of the used vertices.
        vertex_count: number of vertices, used or not, that each target must have.

    Raises:
        SceneFileError: there are more weights than targets, or a target has another vertex count.
    """
    targets = primitive.objects("targets")
    if len(weights) > len(targets) and any(weights[len(targets) :]):
        raise SceneFileError(
            f"{primitive.where}: must have a morph target for each of {len(weights)} weights, "
            f"got {len(targets)}"
        )
    total = base.astype(np.float64)
    for target, weight in zip(targets, weights, strict=False):
        if weight == 0.0 or semantic not in target.members:
            continue
        displacement = accessors.referred(target, semantic, ("VEC3",))
        if len(displacement) != vertex_count:
            raise SceneFileError(
                f"{displacement.where}: must have {vertex_count} elements, got {len(displacement)}"
            )
        total += weight * displacement.as_floats(used)
    return total.astype(np.float32)


def read_influences(
    attributes: dict[str, Elements], used: Int64[np.ndarray, " n"], joint_count: int
) -> tuple[Int32[np.ndarray, "n influences"], Float64[np.ndarray, "n influences"]]:
    """The joints of each vertex, and their weights, which sum to 1.

    Args:
        attributes: the primitive's, with JOINTS_0 and perhaps further sets.
        used: indices of the used vertices.
        joint_count: number of joints of the skin.

    Raises:
        SceneFileError: a joint is out of range, a weight is negative, or a vertex has no weight above zero.
    """
    joints: list[np.ndarray] = []
    weights: list[np.ndarray] = []
    for i in [i for i in range(len(attributes)) if f"JOINTS_{i}" in attributes]:
        if f"WEIGHTS_{i}" not in attributes:
            raise SceneFileError(f"{attributes[f'JOINTS_{i}'].where}: JOINTS_{i} must come with WEIGHTS_{i}")
        joints.append(attributes[f"JOINTS_{i}"].stored[used].astype(np.int64))
        weights.append(attributes[f"WEIGHTS_{i}"].as_floats(used).astype(np.float64))
        used_joints = joints[-1][weights[-1] > 0.0]
        if (joints[-1] < 0).any() or (used_joints >= joint_count).any() or (weights[-1] < 0.0).any():
            raise SceneFileError(
                f"{attributes[f'JOINTS_{i}'].where}: joints must be below {joint_count}, "
                "and weights must not be negative"
            )
    all_weights = np.concatenate(weights, axis=1)
    total = all_weights.sum(axis=1, keepdims=True)
    if not (total > 0.0).all():
        raise SceneFileError(f"{attributes['JOINTS_0'].where}: every vertex must have a weight above zero")
    # The joint of a zero weight may be out of range. Weights stored as bytes do not sum to exactly 1.
    chosen = np.minimum(np.concatenate(joints, axis=1), joint_count - 1).astype(np.int32)
    return chosen, all_weights / total


def skinned(
    positions: Float32[np.ndarray, "n 3"],
    normals: Float32[np.ndarray, "n 3"] | None,
    joints: Int32[np.ndarray, "n influences"],
    weights: Float64[np.ndarray, "n influences"],
    joint_to_world: Float64[np.ndarray, "joints 4 4"],
) -> tuple[Float32[np.ndarray, "n 3"], Float32[np.ndarray, "n 3"] | None]:
    """Positions and normals in world space by linear blend skinning.

    The weighted sum of its joints' matrices transforms each vertex, and the cofactors of the sum its normal.

    Args:
        positions: in the bind pose.
        normals: unit normals in the bind pose, or None.
        joints: indices into `joint_to_world`.
        weights: each row sums to 1.
        joint_to_world: world matrix times inverse bind matrix of each joint.
    """
    blended = np.zeros((len(positions), 3, 4))
    for k in range(joints.shape[1]):
        blended += weights[:, k, None, None] * joint_to_world[joints[:, k], :3]
    placed = np.einsum("nij,nj->ni", blended[:, :, :3], positions.astype(np.float64)) + blended[:, :, 3]
    if normals is None:
        return placed.astype(np.float32), None
    # As in `renderer.scene.scene.transform_normals`.
    rows = blended[:, 0, :3], blended[:, 1, :3], blended[:, 2, :3]
    cofactors = np.stack(
        [np.cross(rows[1], rows[2]), np.cross(rows[2], rows[0]), np.cross(rows[0], rows[1])], axis=1
    )
    turned, _ = unit_rows(np.einsum("nij,nj->ni", cofactors, normals.astype(np.float64)))
    return placed.astype(np.float32), turned
