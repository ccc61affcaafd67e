"""The glTF node hierarchy: the visible nodes of the active scene, and their transforms to world."""

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.gltf_document import GltfDocument
from vpltune.renderer.scene.files.json_object import JsonObject
from vpltune.renderer.scene.files.limits import LARGEST_COORDINATE, MAX_NODES
from vpltune.renderer.scene.transforms import trs_matrices


class GltfNodes:
    """The nodes of one document. The constructor checks that they form a forest.

    Raises:
        SceneFileError: a node has two parents or is its own ancestor, or there are too many nodes.
    """

    def __init__(self, document: GltfDocument) -> None:
        self.nodes = document.list_of("nodes")
        count = len(self.nodes)
        if count > MAX_NODES:
            raise SceneFileError(f"nodes: must be at most {MAX_NODES:,}, got {count:,}")
        self._document = document
        self.children = [node.indices("children", count, "nodes") for node in self.nodes]
        self.parents = self._checked_parents()
        self._world: dict[int, Float64[np.ndarray, "4 4"]] = {}

    def shown(self) -> list[int]:
        """Indices of the visible nodes of the active scene, parents before children.

        Raises:
            SceneFileError: the scene names a node twice, or one out of range.
        """
        pending = self._roots()[::-1]
        order = []
        while pending:
            index = pending.pop()
            visibility = self.nodes[index].extension("KHR_node_visibility")
            if visibility is None or visibility.boolean("visible", True):
                order.append(index)
                pending.extend(self.children[index][::-1])
        return order

    def to_world(self, index: int) -> Float64[np.ndarray, "4 4"]:
        """A node's transform from local to world space, in double precision.

        Raises:
            SceneFileError: a transform is malformed, or the product exceeds the range of coordinates.
        """
        chain = []
        at = index
        while at >= 0 and at not in self._world:
            chain.append(at)
            at = self.parents[at]
        matrix = self._world[at] if at >= 0 else np.eye(4)
        for at in reversed(chain):
            local = local_matrix(self.nodes[at], self._document)
            if local is not None:
                matrix = matrix @ local
                if not np.abs(matrix).max() <= LARGEST_COORDINATE:
                    raise SceneFileError(
                        f"{self.nodes[at].where}: its transform to the world must stay within "
                        f"{LARGEST_COORDINATE:g}"
                    )
            self._world[at] = matrix
        return matrix

    def with_descendants(self, nodes: set[int]) -> set[int]:
        """The nodes with these indices and all their descendants."""
        found = set(nodes)
        pending = list(nodes)
        while pending:
            below = [child for child in self.children[pending.pop()] if child not in found]
            found.update(below)
            pending.extend(below)
        return found

    def _roots(self) -> list[int]:
        scenes = self._document.list_of("scenes")
        if not scenes:
            roots = [index for index, parent in enumerate(self.parents) if parent < 0]
            if roots:
                self._document.warnings.add("the file has no scene: all of its nodes are shown")
            return roots
        scene = self._document.referred(self._document.root, "scene", "scenes")
        if scene is None:
            scene = scenes[0]
            if len(scenes) > 1:
                self._document.warnings.add(
                    f"the file selects none of its {len(scenes)} scenes: the first one is read"
                )
        roots = scene.indices("nodes", len(self.nodes), "nodes")
        named = set(roots)
        if len(named) != len(roots):
            raise SceneFileError(f"{scene.at('nodes')}: must not name a node twice")
        children = [root for root in roots if self.parents[root] >= 0]
        if not children:
            return roots
        self._document.warnings.add(
            f"{scene.at('nodes')}: must be root nodes, and {len(children)} of them have a parent, such as "
            f"{children[0]}; each node is drawn once, where its parents place it"
        )
        below = self.with_descendants({child for root in roots for child in self.children[root]})
        return [root for root in roots if root not in below]

    def _checked_parents(self) -> list[int]:
        parents = [-1] * len(self.nodes)
        for index, children in enumerate(self.children):
            for child in children:
                if parents[child] >= 0:
                    raise SceneFileError(
                        f"nodes[{child}]: must have one parent, got {parents[child]} and {index}"
                    )
                parents[child] = index
        # Every node has at most one parent, so nodes that no root reaches form cycles.
        reached = [index for index, parent in enumerate(parents) if parent < 0]
        for index in reached:  # the list grows during the loop
            reached.extend(self.children[index])
        if len(reached) < len(parents):
            lost = min(set(range(len(parents))) - set(reached))
            raise SceneFileError(f"nodes[{lost}]: is its own ancestor")
        return parents


def local_matrix(node: JsonObject, document: GltfDocument) -> Float64[np.ndarray, "4 4"] | None:
    """A node's matrix, or its translation · rotation · scale; None if it has neither.

    Raises:
        SceneFileError: the matrix is not affine, both forms are given, or the rotation is zero.
    """
    parts = [key for key in ("translation", "rotation", "scale") if key in node.members]
    if "matrix" in node.members:
        if parts:
            raise SceneFileError(f"{node.where}: must not have both matrix and {parts[0]}")
        matrix = node.numbers("matrix", 16).reshape(4, 4).T  # stored column by column
        if (matrix[3] != (0.0, 0.0, 0.0, 1.0)).any():
            raise SceneFileError(
                f"{node.at('matrix')}: its last row must be 0 0 0 1, got {matrix[3].tolist()}"
            )
        return matrix
    if not parts:
        return None
    rotation = node.numbers("rotation", 4, default=(0.0, 0.0, 0.0, 1.0))
    length = np.linalg.norm(rotation)
    if not length > 0.0:
        raise SceneFileError(f"{node.at('rotation')}: must be a unit quaternion, got zero")
    # 1e-3 accepts quaternions printed with four digits without a warning.
    if abs(length - 1.0) > 1e-3:
        document.warnings.tally(
            "1 node has a rotation that is not a unit quaternion; it is normalised",
            "{n} nodes have rotations that are not unit quaternions; they are normalised",
        )
    return trs_matrices(
        node.numbers("translation", 3, default=(0.0, 0.0, 0.0))[None],
        rotation[None],
        node.numbers("scale", 3, default=(1.0, 1.0, 1.0))[None],
    )[0]
