"""Surfaces of a scene in the voxels of a grid: area, mean normal and mean albedo."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from vpltune.renderer.scene.panes import is_pane
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.transforms import transform_points
from vpltune.renderer.scene.triangle_albedo import triangle_albedo

# Most surface samples of one grid; scenes that would need more get a coarser grid. 2²⁴ samples take about a
# second.
SAMPLE_BUDGET = 2**24
# A choice: samples that a triangle may have on average, however many triangles there are. The smallest has 4.
SAMPLES_PER_TRIANGLE = 6
# A choice: samples processed at a time, to bound memory.
SAMPLE_CHUNK = 2**20
# Largest distance between samples in voxels. They can only miss a voxel whose corner is clipped by less.
SAMPLE_SPACING = 0.3
# Voxel coordinates are rounded to this many decimals: coarser than double rounding at any scene scale, and
# much finer than a voxel. Scenes at different scales then give the same grid.
DECIMALS = 5
# A choice: a voxel is plain if the mean of its triangles' unit normals is at least this long; below, two
# faces in it meet at more than 2·arccos 0.85 = 64°.
PLAIN = 0.85


@dataclass(frozen=True, eq=False)
class PlacedTriangles:
    """Triangles in world space."""

    corners: Float64[np.ndarray, "triangles 3 3"]
    """Longest edge first. Mirrored instances keep their front faces."""
    albedo: Float32[np.ndarray, "triangles 3"]
    """Mean albedo, linear."""


def placed_triangles(scene: Scene) -> PlacedTriangles:
    """All triangles of all instances but panes; of panes too, where a scene has nothing else."""
    panes = [is_pane(scene, mesh) for mesh in scene.meshes]
    shown = [instance for instance in scene.instances if not panes[instance.mesh]] or scene.instances
    corners, albedo = [np.zeros((0, 3, 3))], [np.zeros((0, 3), np.float32)]
    colors = [triangle_albedo(scene, mesh) for mesh in scene.meshes]
    for instance in shown:
        mesh = scene.meshes[instance.mesh]
        placed = transform_points(instance.to_world, mesh.positions)[mesh.triangles]
        corners.append(placed[:, ::-1] if np.linalg.det(instance.to_world[:3, :3]) < 0.0 else placed)
        albedo.append(colors[instance.mesh])
    return PlacedTriangles(_longest_edge_first(np.concatenate(corners)), np.concatenate(albedo))


def triangles_in_box(
    triangles: PlacedTriangles, low: Float64[np.ndarray, "3"], high: Float64[np.ndarray, "3"]
) -> PlacedTriangles:
    """The triangles whose bounds touch a box (world units), cut into pieces no longer than the box.

    Each cut halves all three edges, so that little of a large triangle remains.
    """
    corners, albedo = triangles.corners, triangles.albedo
    size = float((high - low).max())
    while True:
        touching = (corners.min(axis=1) <= high).all(axis=1) & (corners.max(axis=1) >= low).all(axis=1)
        corners, albedo = corners[touching], albedo[touching]
        large = np.ptp(corners, axis=1).max(axis=1) > size
        if not large.any():
            return PlacedTriangles(_longest_edge_first(corners), albedo)
        a, b, c = corners[large].transpose(1, 0, 2)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        pieces = [np.stack(quarter, axis=1) for quarter in quarters]
        corners = np.concatenate([corners[~large], *pieces])
        albedo = np.concatenate([albedo[~large], *[albedo[large]] * 4])


def spacing_within_budget(triangles: PlacedTriangles, voxel: float) -> float:
    """The edge of a voxel, enlarged until the surfaces need no more than `SAMPLE_BUDGET` samples.

    With millions of triangles, until they need `SAMPLES_PER_TRIANGLE` on average: a coarser grid saves little
    then, and in the end no voxel would be left to place anything in.
    """
    budget = max(SAMPLE_BUDGET, SAMPLES_PER_TRIANGLE * len(triangles.corners))
    while _sample_counts(triangles.corners, voxel).prod(axis=1, dtype=np.float64).sum() > budget:
        voxel *= 1.26
    return voxel


def _longest_edge_first(
    corners: Float64[np.ndarray, "triangles 3 3"],
) -> Float64[np.ndarray, "triangles 3 3"]:
    edges = np.linalg.norm(corners[:, [1, 2, 0]] - corners, axis=2)
    # Rounded so that the choice between equal edges does not depend on the scene's scale.
    relative = edges / np.maximum(edges.max(axis=1, keepdims=True), np.finfo(np.float64).tiny)
    first = np.round(relative, 6).argmax(axis=1)
    order = (first[:, None] + np.arange(3)) % 3
    return np.take_along_axis(corners, order[:, :, None], axis=1)


def _sample_counts(
    triangles: Float64[np.ndarray, "triangles 3 3"], voxel: float
) -> Int64[np.ndarray, "triangles 2"]:
    """Number of samples along the longest edge and across it, at most `SAMPLE_SPACING` apart."""
    edge = triangles[:, 1] - triangles[:, 0]
    length = np.linalg.norm(edge, axis=1)
    twice_area = np.linalg.norm(np.cross(edge, triangles[:, 2] - triangles[:, 0]), axis=1)
    height = np.divide(twice_area, length, out=np.zeros_like(length), where=length > 0.0)
    spacing = SAMPLE_SPACING * voxel
    return np.ceil(np.round(np.stack([length, height], axis=1) / spacing, DECIMALS)).astype(np.int64) + 1


def _surface_samples(
    triangles: Float64[np.ndarray, "triangles 3 3"], voxel: float
) -> Iterator[tuple[Int64[np.ndarray, " n"], Float64[np.ndarray, "n 3"], Float64[np.ndarray, " n"]]]:
    """Sample points in rows along each longest edge: triangle, position, share of the triangle's area."""
    counts = _sample_counts(triangles, voxel)
    per_triangle = counts.prod(axis=1)
    ends = np.cumsum(per_triangle)
    total = int(ends[-1]) if len(ends) else 0
    for start in range(0, total, SAMPLE_CHUNK):
        sample = np.arange(start, min(start + SAMPLE_CHUNK, total))
        triangle = np.searchsorted(ends, sample, side="right")
        within = sample - (ends - per_triangle)[triangle]
        along, across = counts[triangle].T
        s = (within % along) / np.maximum(along - 1, 1)
        t = (within // along) / np.maximum(across - 1, 1)
        a, b, c = triangles[triangle].transpose(1, 0, 2)
        base = a + s[:, None] * (b - a)
        # Rows get narrower towards the apex, and so do the shares of their samples. The shares add up to 1.
        share = 2.0 * (1.0 - t + 0.5 / across) / ((along * (across + 1)).astype(np.float64))
        yield triangle, base + t[:, None] * (c - base), share


def rasterised(
    triangles: PlacedTriangles,
    low_world: Float64[np.ndarray, "3"],
    voxel: float,
    shape: Int64[np.ndarray, "3"],
) -> tuple[
    Float32[np.ndarray, "nx ny nz"],
    Float32[np.ndarray, "nx ny nz 3"],
    Float32[np.ndarray, "nx ny nz 3"],
    Bool[np.ndarray, "nx ny nz"],
]:
    """Area, mean front-face normal, mean albedo, and whether there is detail in each voxel of a grid.

    A voxel is occupied if its area is positive. Means are weighted by area. Detail is where unit normals
    differ, each weighted by the share of its triangle in the voxel: small pieces outweigh the ground below.
    What lies outside the grid is left out.
    """
    cells = int(shape.prod())
    area = np.zeros(cells)
    sums = np.zeros((10, cells))
    corners = triangles.corners
    area_vector = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / voxel**2
    # A degenerate triangle has no area; 1e-6 keeps its voxels occupied.
    triangle_area = np.maximum(np.linalg.norm(area_vector, axis=1), 1e-6)
    weights = np.concatenate(
        [
            area_vector,
            triangle_area[:, None] * triangles.albedo,
            area_vector / triangle_area[:, None],
            np.ones((len(corners), 1)),
        ],
        axis=1,
    ).T
    for triangle, positions, share in _surface_samples(corners, voxel):
        index = np.floor(np.round((positions - low_world) / voxel, DECIMALS)).astype(np.int64)
        inside = ((index >= 0) & (index < shape)).all(axis=1)
        index, triangle, share = index[inside], triangle[inside], share[inside]
        flat = np.ravel_multi_index(tuple(index.T), tuple(shape))
        area += np.bincount(flat, share * triangle_area[triangle], cells)
        for total, weight in zip(sums, weights, strict=True):
            total += np.bincount(flat, share * weight[triangle], cells)
    means = (sums[:6] / np.maximum(area, np.finfo(np.float64).tiny)).T
    normals, albedo = np.round(means[:, :3], 3), np.round(means[:, 3:], 3)
    unit = sums[6:9] / np.maximum(sums[9], np.finfo(np.float64).tiny)
    detail = (area > 0.0) & (np.round(np.linalg.norm(unit, axis=0), 3) < PLAIN)
    return (
        area.reshape(shape).astype(np.float32),
        normals.reshape(*shape, 3).astype(np.float32),
        albedo.reshape(*shape, 3).astype(np.float32),
        detail.reshape(shape),
    )
