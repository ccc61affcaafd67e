"""Rays through `shaders/common/ray_hierarchy.glsl`, and the same against every triangle in float64."""

from collections.abc import Callable

import moderngl
import numpy as np
import pytest

from vpltune.renderer.gpu import shader_library
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.ray_hierarchy import RAY_DEFINES, RAY_READS, RayHierarchy
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.transforms import transform_points

_SHADER = """
layout(local_size_x = 64) in;
#include "common/ray_hierarchy.glsl"
struct Ray { vec3 origin; float longest; vec3 direction; float padding; };
layout(std430, binding = RAYS_BINDING) readonly buffer Rays { Ray rays[]; };
layout(std430, binding = DISTANCES_BINDING) writeonly buffer Distances { vec2 distances[]; };
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < rays.length()) {
        Ray ray = rays[i];
        RayHit hit = ray_hit(ray.origin, ray.direction, ray.longest);
        distances[i] = vec2(hit.distance, hit.triangle != RAY_NO_TRIANGLE ? 1.0 : 0.0);
    }
}
"""

Trace = Callable[..., tuple[np.ndarray, np.ndarray]]


def ray_tracer(context: moderngl.Context, first: RayHierarchy | None = None) -> Trace:
    """(hierarchy, origins, directions, longest) → distances, and whether anything was met; on the GPU.

    Without `first`, for scenes whose surfaces are all opaque; else for those that need what it needs.
    """
    resources = Resources(context)
    defines, reads = (RAY_DEFINES, RAY_READS) if first is None else (first.defines, first.reads)
    shipped = shader_library.read_shader
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            shader_library, "read_shader", lambda name: _SHADER if name == "trace.comp" else shipped(name)
        )
        program = ComputeProgram(resources, "trace", defines, reads=(*reads, "rays"), writes=("distances",))

    def trace(hierarchy: RayHierarchy, origins, directions, longest=np.inf):
        rays = np.zeros((len(origins), 8), np.float32)
        rays[:, :3], rays[:, 3], rays[:, 4:7] = origins, longest, directions
        hierarchy.add_to(resources)
        resources["rays"] = context.buffer(rays)
        resources["distances"] = context.buffer(reserve=8 * len(rays))
        program.dispatch(-(-len(rays) // 64))
        distances = np.frombuffer(resources.read("distances"), np.float32).reshape(-1, 2)
        return distances[:, 0], distances[:, 1] > 0.0

    return trace


def hierarchy_of(context: moderngl.Context, scene: Scene) -> tuple[RayHierarchy, SceneBuffers]:
    buffers = SceneBuffers(context, scene)
    return RayHierarchy(context, scene, buffers), buffers


def world_triangles(scene: Scene, transforms=None) -> np.ndarray:
    """[triangles, 3, 3], world units, placed by the scene or by other transforms."""
    placed = [i.to_world for i in scene.instances] if transforms is None else transforms
    return np.concatenate(
        [
            transform_points(matrix, mesh.positions)[mesh.triangles]
            for matrix, mesh in zip(placed, (scene.meshes[i.mesh] for i in scene.instances), strict=True)
        ]
    )


def nearest_distances(triangles: np.ndarray, origins, directions) -> np.ndarray:
    """Distance to the nearest triangle of either side, ∞ where there is none (Möller and Trumbore 1997)."""
    corner, edges = triangles[:, 0], triangles[:, 1:] - triangles[:, :1]
    nearest = np.full(len(origins), np.inf)
    block = max(1, 2_000_000 // len(triangles))
    for start in range(0, len(origins), block):
        rows = slice(start, start + block)
        origin = np.asarray(origins[rows], np.float64)[:, None]
        direction = np.asarray(directions[rows], np.float64)[:, None]
        across = np.cross(direction, edges[None, :, 1])
        determinant = (edges[None, :, 0] * across).sum(axis=2)
        with np.errstate(all="ignore"):
            offset = origin - corner
            u = (offset * across).sum(axis=2) / determinant
            lifted = np.cross(offset, edges[None, :, 0])
            v = (direction * lifted).sum(axis=2) / determinant
            t = (edges[None, :, 1] * lifted).sum(axis=2) / determinant
            hit = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t > 0.0)
        nearest[rows] = np.where(hit, t, np.inf).min(axis=1)
    return nearest


def rays_within(bounds: np.ndarray, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rays from anywhere in a box, every way; of single precision, as the GPU takes them."""
    random = np.random.default_rng(seed)
    origins = bounds[0] + random.random((count, 3)) * (bounds[1] - bounds[0])
    directions = random.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return origins.astype(np.float32), directions.astype(np.float32)
