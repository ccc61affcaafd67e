"""glTF morph targets and skins, applied once: the mesh as it stands at rest."""

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
    """What bends the mesh of a node."""

    weights: tuple[float, ...] = ()
    """Of the morph targets."""
    joint_to_world: Float64[np.ndarray, "joints 4 4"] | None = None
    """Each joint's world matrix times its inverse bind matrix; None without a skin."""
    is_animated: bool = False
    """Whether the joints move, so that the mesh must keep what it was before they bent it."""


def read_deformation(
    node: JsonObject,
    mesh: JsonObject,
    document: GltfDocument,
    nodes: GltfNodes,
    accessors: GltfAccessors,
    moving_nodes: set[int],
) -> Deformation:
    """The morph weights of a node (its own, else its mesh's) and the pose of its skin at rest.

    Raises:
        SceneFileError: a reference is out of range, or counts disagree.
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
    """The nodes that are a skin's joints, and their inverse bind matrices.

    Raises:
        SceneFileError: no joint, one out of range, or fewer matrices than joints.
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

    Raises:
        SceneFileError: more weights than targets, or a target of another vertex count.
    """
    targets = primitive.objects("targets")
    if len(weights) > len(targets) and any(weights[len(targets) :]):
        raise SceneFileError(
            f"{primitive.where}: has {len(targets)} morph targets, and there are {len(weights)} weights"
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
    """The joints that each vertex follows, and how much: rows of weights sum to 1.

    Raises:
        SceneFileError: a joint out of range, a negative weight, or a vertex without any.
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
    # A weight of zero may name any joint; weights stored in bytes do not quite sum to one.
    chosen = np.minimum(np.concatenate(joints, axis=1), joint_count - 1).astype(np.int32)
    return chosen, all_weights / total


def skinned(
    positions: Float32[np.ndarray, "n 3"],
    normals: Float32[np.ndarray, "n 3"] | None,
    joints: Int32[np.ndarray, "n influences"],
    weights: Float64[np.ndarray, "n influences"],
    joint_to_world: Float64[np.ndarray, "joints 4 4"],
) -> tuple[Float32[np.ndarray, "n 3"], Float32[np.ndarray, "n 3"] | None]:
    """Linear blend skinning into world space: each vertex under the weighted sum of its joints' matrices."""
    blended = np.zeros((len(positions), 3, 4))
    for k in range(joints.shape[1]):
        blended += weights[:, k, None, None] * joint_to_world[joints[:, k], :3]
    placed = np.einsum("nij,nj->ni", blended[:, :, :3], positions.astype(np.float64)) + blended[:, :, 3]
    if normals is None:
        return placed.astype(np.float32), None
    # Normals go by the cofactors, as in `renderer.scene.scene.transform_normals`.
    rows = blended[:, 0, :3], blended[:, 1, :3], blended[:, 2, :3]
    cofactors = np.stack(
        [np.cross(rows[1], rows[2]), np.cross(rows[2], rows[0]), np.cross(rows[0], rows[1])], axis=1
    )
    turned, _ = unit_rows(np.einsum("nij,nj->ni", cofactors, normals.astype(np.float64)))
    return placed.astype(np.float32), turned
