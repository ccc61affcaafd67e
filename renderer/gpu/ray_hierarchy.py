"""Rays in compute shaders: the two levels of boxes that `shaders/common/ray_hierarchy.glsl` walks through.

Below, one tree for each mesh in the mesh's own space, made once. Above, a tree over the instances as they
stand, made anew whenever one of them has moved. A skinned mesh falls into rigid pieces
(`renderer.gpu.rigid_pieces`).
"""

from dataclasses import dataclass

import moderngl
import numpy as np
from jaxtyping import Float32, Float64, Int64

from vpltune.renderer.gpu.bounding_volumes import (
    COUNT_BITS,
    LEAF_ITEMS,
    NODE_DTYPE,
    BoundingVolumes,
    build_bounding_volumes,
)
from vpltune.renderer.gpu.gpu_context import check_errors
from vpltune.renderer.gpu.ray_alpha import RayAlpha
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.rigid_pieces import first_matrix_rows, pieces_of_mesh
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.gpu.shader_library import Define
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.triangle_albedo import triangle_albedo

# Levels of a mesh's tree, and of the tree over instances; deeper parts become larger leaves. Choices, which
# set the stack of a ray.
_MESH_DEPTH, _TOP_DEPTH = 40, 21

RAY_DEFINES = {
    "RAY_COUNT_BITS": COUNT_BITS,
    # One entry for each level, the bottom, the way out of an instance, and one that is written ahead.
    "RAY_STACK_SIZE": _MESH_DEPTH + _TOP_DEPTH + 3,
}
"""What a shader that includes `common/ray_hierarchy.glsl` is compiled with."""
RAY_READS = ("ray_nodes", "ray_triangles", "ray_instances")
"""And what its program declares. Both are those of a scene whose surfaces are all opaque."""

# Position and, in the fourth number, one channel of the albedo: without it the number would be padding.
_TRIANGLE_DTYPE = np.dtype([(corner, "f4", 4) for corner in "abc"])
_INSTANCE_DTYPE = np.dtype([("world_to_instance", "f4", (3, 4)), ("root", "u4", 4)])

# A mesh scaled flat is kept as a sheet so much thinner than it is long: its matrix must have an inverse.
_THINNEST = 1e-5
# What float32 may lose when a ray goes from the world to an instance, in parts of the coordinates.
_ROUNDING = 2e-6


@dataclass(frozen=True, eq=False)
class _Placed:
    """Trees and what places each: a row among the transforms of all instances, then all joint matrices."""

    trees: list[BoundingVolumes]
    triangles: list[np.ndarray]
    """Corners [triangles, 3, 3] of each tree, in leaf order."""
    surfaces: list[tuple[int, np.ndarray]]
    """Mesh of each tree, and which of its triangles, in leaf order."""
    instances: list[tuple[int, int]]
    """Tree and matrix row of each."""


class RayHierarchy:
    """The buffers behind `ray_hit` of shaders/common/ray_hierarchy.glsl.

    Takes 48 bytes for each triangle of a mesh and 33 to 61 for the boxes around it (64 for each pair of
    nodes), however often the mesh is placed; and 128 for each instance. The mean albedo of a triangle takes
    no room of its own. A triangle with holes takes 24 bytes more, and a texel of its texture one. Building
    takes about 1 µs for each triangle.

    Example:
        >>> rays = RayHierarchy(context, scene, scene_buffers)
        >>> rays.add_to(resources)
        >>> program = ComputeProgram(resources, "rays", rays.defines, reads=rays.reads)
        >>> rays.update()  # after scene_buffers.set_pose

    Raises:
        MachineError: the GPU ran out of memory.
    """

    def __init__(self, context: moderngl.Context, scene: Scene, scene_buffers: SceneBuffers):
        self._scene_buffers = scene_buffers
        placed = _placed_trees(scene)
        self._rows = np.array([row for _, row in placed.instances], np.int64)
        self._first_mesh_node = 2 * max(1, len(placed.instances) - 1)
        roots, nodes, triangles = self._joined(scene, placed)
        alpha = RayAlpha(scene, placed.surfaces)
        of_instance = np.array([tree for tree, _ in placed.instances], np.int64)
        boxes = np.array([[tree.low, tree.high] for tree in placed.trees], np.float64).reshape(-1, 2, 3)
        self._centers = boxes.mean(axis=1)[of_instance]
        self._halves = 0.5 * (boxes[:, 1] - boxes[:, 0])[of_instance]
        self._records = np.zeros(max(1, len(of_instance)), _INSTANCE_DTYPE)
        self._records["root"][: len(of_instance), 0] = roots[of_instance]
        self._nodes = context.buffer(nodes)
        self._triangles = context.buffer(triangles)
        self._alpha: moderngl.Buffer | None = None
        if alpha.is_needed:
            self._records["root"][: len(of_instance), 1:3] = alpha.of_trees[of_instance]
            self._alpha = context.buffer(alpha.words)
        self._instances = context.buffer(reserve=self._records.nbytes)
        self._placed: np.ndarray | None = None
        self.update()
        check_errors(context, f"the ray hierarchy of scene {scene.name}")

    def update(self) -> None:
        """Follow the scene buffers' pose: one write for each of two buffers if anything has moved, else none.

        Takes a millisecond for some 60 instances, 20 ms for 10,000; comparing takes a fiftieth of that.
        """
        buffers = self._scene_buffers
        to_world = np.concatenate([buffers.transforms, buffers.joint_matrices])[self._rows]
        if self._placed is not None and np.array_equal(to_world, self._placed):
            return
        self._placed = to_world
        to_world, is_seen = _with_inverse(to_world)
        inverse = np.linalg.inv(to_world)
        self._records["world_to_instance"][: len(inverse)] = inverse[:, :3]
        self._instances.write(self._records)
        self._nodes.write(self._top_nodes(to_world, np.flatnonzero(is_seen)))

    @property
    def defines(self) -> dict[str, Define]:
        """What a shader that includes `common/ray_hierarchy.glsl` is compiled with, for this scene."""
        return dict(RAY_DEFINES) if self._alpha is None else {**RAY_DEFINES, "RAYS_MEET_HOLES": 1}

    @property
    def reads(self) -> tuple[str, ...]:
        """And what its program declares."""
        return RAY_READS if self._alpha is None else (*RAY_READS, "ray_alpha")

    def add_to(self, resources: Resources) -> None:
        """Make this the scene that rays of programs with `reads` meet."""
        if self._alpha is not None:
            resources["ray_alpha"] = self._alpha
        resources["ray_nodes"] = self._nodes
        resources["ray_triangles"] = self._triangles
        resources["ray_instances"] = self._instances

    def _joined(self, scene: Scene, placed: _Placed) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Roots, all nodes (room for the instances' first) and all triangles, with their places put right."""
        nodes = [np.zeros(self._first_mesh_node, NODE_DTYPE)]
        roots = np.zeros(len(placed.trees), np.uint32)
        first_node, first_triangle = self._first_mesh_node, 0
        for index, (tree, triangles) in enumerate(zip(placed.trees, placed.triangles, strict=True)):
            own = tree.nodes.reshape(-1).copy()
            own["child"] = _moved(own["child"], first_node, first_triangle)
            roots[index] = _moved(np.array([tree.root], np.uint32), first_node, first_triangle)[0]
            nodes.append(own)
            first_node, first_triangle = first_node + len(own), first_triangle + len(triangles)
        assert max(first_node, first_triangle) < 1 << (32 - COUNT_BITS), "too many triangles for 32-bit nodes"
        corners = np.zeros(max(1, first_triangle), _TRIANGLE_DTYPE)
        if first_triangle:
            joined = np.concatenate(placed.triangles)
            albedo = [triangle_albedo(scene, scene.meshes[mesh])[own] for mesh, own in placed.surfaces]
            channels = np.concatenate(albedo).T
            for corner, name in enumerate("abc"):
                corners[name][:, :3] = joined[:, corner]
                corners[name][:, 3] = channels[corner]
        return roots, np.concatenate(nodes), corners

    def _top_nodes(self, to_world: np.ndarray, seen: Int64[np.ndarray, " seen"]) -> np.ndarray:
        """The tree over instances: its root is always the pair at 0."""
        nodes = np.zeros((self._first_mesh_node // 2, 2), NODE_DTYPE)
        # Boxes that no ray reaches.
        nodes["low"] = nodes["high"] = np.finfo(np.float32).max
        nodes["child"] = 1
        if not len(seen):
            return nodes
        low, high = _world_boxes(to_world[seen], self._centers[seen], self._halves[seen])
        tree = build_bounding_volumes(low, high, 1, _TOP_DEPTH)
        leaves = (seen[tree.order] << COUNT_BITS) | 1
        if not len(tree.nodes):
            nodes[0, 0] = (low[0], leaves[0], high[0], 0)
            return nodes
        nodes[: len(tree.nodes)] = tree.nodes
        child = nodes["child"][: len(tree.nodes)]
        is_leaf = (child & ((1 << COUNT_BITS) - 1)) != 0
        child[is_leaf] = leaves[child[is_leaf] >> COUNT_BITS]
        return nodes


def _moved(child: np.ndarray, first_node: int, first_item: int) -> np.ndarray:
    is_leaf = (child & ((1 << COUNT_BITS) - 1)) != 0
    return child + (np.where(is_leaf, first_item, first_node) << COUNT_BITS).astype(np.uint32)


def _placed_trees(scene: Scene) -> _Placed:
    placed = _Placed([], [], [], [])
    rows = first_matrix_rows(scene)
    pieces: dict[int, list[tuple[int, int]]] = {}
    for index, instance in enumerate(scene.instances):
        mesh = scene.meshes[instance.mesh]
        if instance.mesh not in pieces:
            pieces[instance.mesh] = [
                (joint, _add_tree(placed, corners, instance.mesh, own))
                for joint, corners, own in pieces_of_mesh(mesh)
                if len(corners)
            ]
        first = rows[index]
        placed.instances.extend((tree, first + joint) for joint, tree in pieces[instance.mesh])
    return placed


def _add_tree(
    placed: _Placed,
    corners: Float32[np.ndarray, "triangles 3 3"],
    mesh: int,
    own: Int64[np.ndarray, " triangles"],
) -> int:
    tree = build_bounding_volumes(corners.min(axis=1), corners.max(axis=1), LEAF_ITEMS, _MESH_DEPTH)
    placed.trees.append(tree)
    placed.triangles.append(corners[tree.order])
    placed.surfaces.append((mesh, own[tree.order]))
    return len(placed.trees) - 1


def _with_inverse(
    to_world: Float64[np.ndarray, "n 4 4"],
) -> tuple[Float64[np.ndarray, "n 4 4"], np.ndarray]:
    """The matrices, flat ones made `_THINNEST` thick; and which are seen: not those shrunk to a line."""
    linear = to_world[:, :3, :3]
    scale = np.abs(linear).max(axis=(1, 2))
    flat = np.flatnonzero(np.abs(np.linalg.det(linear)) <= _THINNEST * scale**3)
    is_seen = np.ones(len(to_world), bool)
    if len(flat):
        to_world = to_world.copy()
        u, sizes, v = np.linalg.svd(linear[flat])
        is_seen[flat] = sizes[:, 1] > 0.0
        thickened = np.maximum(sizes, np.where(sizes[:, :1] > 0.0, _THINNEST * sizes[:, :1], 1.0))
        to_world[flat, :3, :3] = u * thickened[:, None, :] @ v
    return to_world, is_seen


def _world_boxes(
    to_world: np.ndarray, centers: np.ndarray, halves: np.ndarray
) -> tuple[Float32[np.ndarray, "n 3"], Float32[np.ndarray, "n 3"]]:
    """Boxes around placed boxes, rounded outwards."""
    linear, offset = to_world[:, :3, :3], to_world[:, :3, 3]
    center = (linear @ centers[:, :, None])[..., 0] + offset
    half = (np.abs(linear) @ halves[:, :, None])[..., 0]
    half += _ROUNDING * (np.abs(center) + half)
    return (center - half).astype(np.float32), (center + half).astype(np.float32)
