"""glTF morph targets and skins, applied once to get the mesh at rest."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int32, Int64

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.gltf_accessors import Elements, GltfAccessors
from vpltune.renderer.scene.files.gltf_document import GltfDocument
from vpltune.renderer.scene.files.gltf_nodes import GltfNodes
from vpltune.renderer.scene.files.json_object import JsonObject
from vpltune.renderer.scene.files.limits import VERTEX_CHUNK, DecodedBytes
from vpltune.renderer.scene.files.surface import unit_rows


@dataclass(frozen=True, eq=False)
class RestSkin:
    """A skin of the document at rest."""

    joints: list[int]
    """The nodes of its joints."""
    inverse_bind: Float64[np.ndarray, "joints 4 4"]
    joint_to_world: Float64[np.ndarray, "joints 4 4"]
    """World matrix times inverse bind matrix of each joint."""
    is_animated: bool
    """Whether the joints move, so that the mesh must keep its bind pose."""


@dataclass(frozen=True, eq=False)
class Deformation:
    """The deformation of the mesh of a node."""

    weights: tuple[float, ...] = ()
    """Weights of the morph targets."""
    skin: RestSkin | None = None


class GltfDeformations:
    """The skins and morph weights of one document. Nodes that deform a mesh alike share a deformation.

    Args:
        document: the document.
        nodes: gives the joints' transforms to world.
        accessors: reads the inverse bind matrices.
        moving_nodes: indices of the animated nodes.
    """

    def __init__(
        self, document: GltfDocument, nodes: GltfNodes, accessors: GltfAccessors, moving_nodes: set[int]
    ) -> None:
        self._document = document
        self._nodes = nodes
        self._accessors = accessors
        self._moving_nodes = moving_nodes
        self._skins: dict[str, RestSkin] = {}
        self._deformations: dict[tuple[str, str], Deformation] = {}

    def of(self, node: JsonObject, mesh: JsonObject) -> Deformation:
        """The morph weights of a node (its own, or else its mesh's) and its skin.

        Raises:
            SceneFileError: a reference is out of range, or counts do not match.
        """
        holder = node if "weights" in node.members else mesh
        skin = self._document.referred(node, "skin", "skins")
        key = (holder.where, "" if skin is None else skin.where)
        if key not in self._deformations:
            listed = holder.members.get("weights")
            count = len(listed) if isinstance(listed, list) else 0
            weights = tuple(holder.numbers("weights", count, default=()).tolist())
            self._deformations[key] = Deformation(weights, None if skin is None else self._skin(skin))
        return self._deformations[key]

    def _skin(self, skin: JsonObject) -> RestSkin:
        if skin.where not in self._skins:
            joints = skin.indices("joints", len(self._nodes.nodes), "nodes")
            if not joints:
                raise SceneFileError(f"{skin.where}: must have at least one joint")
            inverse_bind = self._inverse_bind(skin, len(joints))
            to_world = np.stack([self._nodes.to_world(joint) for joint in joints]) @ inverse_bind
            is_animated = any(joint in self._moving_nodes for joint in joints)
            self._skins[skin.where] = RestSkin(joints, inverse_bind, to_world, is_animated)
        return self._skins[skin.where]

    def _inverse_bind(self, skin: JsonObject, joint_count: int) -> Float64[np.ndarray, "joints 4 4"]:
        if "inverseBindMatrices" not in skin.members:
            return np.tile(np.eye(4), (joint_count, 1, 1))
        inverse_bind = self._accessors.referred(skin, "inverseBindMatrices", ("MAT4",))
        if len(inverse_bind) < joint_count:
            raise SceneFileError(
                f"{inverse_bind.where}: must have a matrix for each of {joint_count} joints, "
                f"got {len(inverse_bind)}"
            )
        stored = inverse_bind.as_floats(np.arange(joint_count)).astype(np.float64)
        return stored.reshape(-1, 4, 4).transpose(0, 2, 1)


def morphed(
    base: Float32[np.ndarray, "n 3"],
    semantic: str,
    primitive: JsonObject,
    weights: tuple[float, ...],
    accessors: GltfAccessors,
    used: Int64[np.ndarray, " n"],
    vertex_count: int,
    budget: DecodedBytes,
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
        budget: the limit of all displacements.

    Raises:
        SceneFileError: there are more weights than targets, or a target has another vertex count or a value
            that is not finite.
    """
    targets = primitive.objects("targets")
    if len(weights) > len(targets) and any(weights[len(targets) :]):
        raise SceneFileError(
            f"{primitive.where}: must have a morph target for each of {len(weights)} weights, "
            f"got {len(targets)}"
        )
    total = base.astype(np.float64)
    for index, target in enumerate(targets):
        if semantic not in target.members:
            continue
        displacement = accessors.referred(target, semantic, ("VEC3",))
        if len(displacement) != vertex_count:
            raise SceneFileError(
                f"{displacement.where}: must have {vertex_count} elements, got {len(displacement)}"
            )
        # A target of weight 0 is read too: its numbers must be finite like all others.
        budget.spend(12 * len(used), displacement.where)
        offsets = displacement.as_floats(used)
        if index < len(weights) and weights[index] != 0.0:
            total += weights[index] * offsets
    return total.astype(np.float32)


def read_influences(
    attributes: dict[str, Elements],
    used: Int64[np.ndarray, " n"],
    joint_count: int,
    decoded: DecodedBytes,
) -> tuple[Int32[np.ndarray, "n influences"], Float64[np.ndarray, "n influences"]]:
    """The joints of each vertex, and their weights, which sum to 1.

    Args:
        attributes: the primitive's, with JOINTS_0 and perhaps further sets.
        used: indices of the used vertices.
        joint_count: number of joints of the skin.
        decoded: the memory limit.

    Raises:
        SceneFileError: a joint is out of range, a weight is negative, a vertex has no weight above zero, or
            memory runs out.
    """
    sets = [i for i in range(len(attributes)) if f"JOINTS_{i}" in attributes]
    for i in sets:
        if f"WEIGHTS_{i}" not in attributes:
            raise SceneFileError(f"{attributes[f'JOINTS_{i}'].where}: JOINTS_{i} must come with WEIGHTS_{i}")
    shape = (len(used), 4 * len(sets))
    decoded.spend(12 * shape[0] * shape[1], attributes["JOINTS_0"].where)
    joints, weights = np.empty(shape, np.int32), np.empty(shape, np.float64)
    for start in range(0, len(used), VERTEX_CHUNK):
        rows = slice(start, start + VERTEX_CHUNK)
        for column, i in enumerate(sets):
            chunk = np.s_[rows, 4 * column : 4 * column + 4]
            stored = attributes[f"JOINTS_{i}"].stored[used[rows]].astype(np.int64)
            weights[chunk] = attributes[f"WEIGHTS_{i}"].as_floats(used[rows])
            if (
                (stored < 0).any()
                or (stored[weights[chunk] > 0.0] >= joint_count).any()
                or (weights[chunk] < 0.0).any()
            ):
                raise SceneFileError(
                    f"{attributes[f'JOINTS_{i}'].where}: joints must be below {joint_count}, "
                    "and weights must not be negative"
                )
            # The joint of a zero weight may be out of range.
            joints[chunk] = np.minimum(stored, joint_count - 1)
    total = weights.sum(axis=1, keepdims=True)
    if not (total > 0.0).all():
        raise SceneFileError(f"{attributes['JOINTS_0'].where}: every vertex must have a weight above zero")
    weights /= total  # weights stored as bytes do not sum to exactly 1
    return joints, weights


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
    placed = np.empty_like(positions)
    turned = None if normals is None else np.empty_like(normals)
    for start in range(0, len(positions), VERTEX_CHUNK):
        rows = slice(start, start + VERTEX_CHUNK)
        blended = np.zeros((len(positions[rows]), 3, 4))
        for k in range(joints.shape[1]):
            blended += weights[rows, k, None, None] * joint_to_world[joints[rows, k], :3]
        moved = np.einsum("nij,nj->ni", blended[:, :, :3], positions[rows].astype(np.float64))
        placed[rows] = moved + blended[:, :, 3]
        if normals is None or turned is None:
            continue
        # As in `renderer.scene.scene.transform_normals`.
        x, y, z = blended[:, 0, :3], blended[:, 1, :3], blended[:, 2, :3]
        cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)
        turned[rows], _ = unit_rows(np.einsum("nij,nj->ni", cofactors, normals[rows].astype(np.float64)))
    return placed, turned
