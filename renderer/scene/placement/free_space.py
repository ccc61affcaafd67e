"""Free space of a scene: an occupancy grid of its surfaces, a distance field, and ray marching through it.

Distances are in voxels and positions in voxel units from the grid's low corner. The grid of a scaled scene is
therefore the same, and so is every choice made from it.
"""

import functools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from vpltune.renderer.scene.scene import Scene, transform_points

# A choice: number of voxels in the scene's bounds.
VOXEL_BUDGET = 64**3
# A choice: most voxels along the longest side. An elongated scene gets fewer voxels because of it.
LONGEST_SIDE = 128
# A choice: empty voxels around the scene's bounds. The odd fraction keeps surfaces at round fractions of the
# bounds away from voxel faces.
MARGIN = 2.37
# Most surface samples of one grid; scenes that would need more get a coarser grid. 2²⁴ samples take about a
# second.
SAMPLE_BUDGET = 2**24
# A choice: samples processed at a time, to bound memory.
SAMPLE_CHUNK = 2**20
# Largest distance between samples in voxels. They can only miss a voxel whose corner is clipped by less.
SAMPLE_SPACING = 0.3
# Voxel coordinates are rounded to this many decimals: coarser than double rounding at any scene scale, and
# much finer than a voxel. Scenes at different scales then give the same grid.
DECIMALS = 5
# Shortest march step in voxels. Half a voxel cannot jump over a surface one voxel thick, except at a corner.
SHORTEST_STEP = 0.5


@dataclass(frozen=True, eq=False)
class FreeSpace:
    """A grid of cubic voxels around a scene."""

    low_world: Float64[np.ndarray, "3"]
    """Low corner of the grid in world units."""
    voxel_world: float
    """Edge of a voxel in world units."""
    occupied: Bool[np.ndarray, "nx ny nz"]
    """Whether a surface passes through the voxel."""
    clearance: Float32[np.ndarray, "nx ny nz"]
    """Distance in voxels from the voxel's centre to the centre of the nearest occupied voxel."""
    area: Float32[np.ndarray, "nx ny nz"]
    """Surface area in the voxel, in squared voxels."""
    normals: Float32[np.ndarray, "nx ny nz 3"]
    """Area-weighted mean of the front-face normals in the voxel. Length 0 (opposing faces cancel) to 1."""

    def to_world(self, positions: Float64[np.ndarray, "*n 3"]) -> Float64[np.ndarray, "*n 3"]:
        """World positions from positions in voxel units."""
        return self.low_world + positions * self.voxel_world

    def to_voxels(self, positions_world: Float64[np.ndarray, "*n 3"]) -> Float64[np.ndarray, "*n 3"]:
        """Positions in voxel units, rounded to `DECIMALS`, from world positions."""
        return np.round((positions_world - self.low_world) / self.voxel_world, DECIMALS)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of voxels along x, y and z."""
        x, y, z = self.occupied.shape
        return x, y, z

    def clearance_at(self, positions: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, " n"]:
        """Clearance at positions in voxel units. Outside the grid, the distance to the grid is added."""
        limit = np.array(self.shape) - 1
        index = np.clip(np.floor(positions).astype(np.int64), 0, limit)
        outside = np.linalg.norm(positions - np.clip(positions, 0.0, limit + 1.0), axis=1)
        return self.clearance[index[:, 0], index[:, 1], index[:, 2]] + outside


@dataclass(frozen=True, eq=False)
class RayHits:
    """The first hits of rays. A ray without a hit left the grid."""

    hit: Bool[np.ndarray, "*rays"]
    distance: Float64[np.ndarray, "*rays"]
    """Distance in voxels; infinite without a hit."""
    voxel: Int64[np.ndarray, "*rays"]
    """Flat index of the voxel hit; −1 without a hit."""


@functools.lru_cache(maxsize=1)
def free_space(scene: Scene) -> FreeSpace:
    """The occupancy grid of a scene. The grid of the last scene is cached; scenes are immutable."""
    low, high = scene.bounds()
    extent = high - low
    size = float(extent.max()) or 1.0
    # Treat a flat scene as at least 1/64 as thick as it is long. Otherwise the voxels would shrink with it.
    volume = float(np.prod(np.maximum(extent / size, 1.0 / 64.0)))
    relative_voxel = max((volume / VOXEL_BUDGET) ** (1.0 / 3.0), 1.0 / LONGEST_SIDE)
    triangles = _triangles_world(scene)
    while (
        _sample_counts(triangles, size * relative_voxel).prod(axis=1, dtype=np.float64).sum() > SAMPLE_BUDGET
    ):
        relative_voxel *= 1.26
    voxel = size * relative_voxel
    low_world = low - MARGIN * voxel
    shape = np.ceil(np.round(extent / voxel, DECIMALS) + 2.0 * MARGIN).astype(np.int64)
    area, normals = _rasterised(triangles, low_world, voxel, shape)
    return FreeSpace(low_world, voxel, area > 0.0, _distance_to_occupied(area > 0.0), area, normals)


def _triangles_world(scene: Scene) -> Float64[np.ndarray, "triangles 3 3"]:
    """Corners of all placed triangles, longest edge first. Mirrored instances keep their front faces."""
    placed = []
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        corners = transform_points(instance.to_world, mesh.positions)[mesh.triangles]
        placed.append(corners[:, ::-1] if np.linalg.det(instance.to_world[:3, :3]) < 0.0 else corners)
    corners = np.concatenate(placed) if placed else np.zeros((0, 3, 3))
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


def _rasterised(
    triangles: Float64[np.ndarray, "triangles 3 3"],
    low_world: Float64[np.ndarray, "3"],
    voxel: float,
    shape: Int64[np.ndarray, "3"],
) -> tuple[Float32[np.ndarray, "nx ny nz"], Float32[np.ndarray, "nx ny nz 3"]]:
    """Area and mean front-face normal in each voxel. A voxel is occupied if its area is positive."""
    cells = int(shape.prod())
    touched = np.zeros(cells)
    area = np.zeros(cells)
    normal_sum = np.zeros((3, cells))
    area_vector = (
        0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / voxel**2
    )
    triangle_area = np.linalg.norm(area_vector, axis=1)
    for triangle, positions, share in _surface_samples(triangles, voxel):
        index = np.floor(np.round((positions - low_world) / voxel, DECIMALS)).astype(np.int64)
        flat = np.ravel_multi_index(tuple(np.clip(index, 0, shape - 1).T), tuple(shape))
        touched += np.bincount(flat, minlength=cells)
        area += np.bincount(flat, weights=share * triangle_area[triangle], minlength=cells)
        for axis in range(3):
            normal_sum[axis] += np.bincount(flat, share * area_vector[triangle, axis], minlength=cells)
    # A degenerate triangle has no area; 1e-6 keeps its voxels occupied.
    area = np.where(touched > 0.0, np.maximum(area, 1e-6), 0.0)
    normals = np.round(normal_sum / np.maximum(area, 1e-6), 3).T
    return area.reshape(shape).astype(np.float32), normals.reshape(*shape, 3).astype(np.float32)


def _distance_to_occupied(occupied: Bool[np.ndarray, "nx ny nz"]) -> Float32[np.ndarray, "nx ny nz"]:
    """Exact Euclidean distance transform, axis by axis (Felzenszwalb and Huttenlocher 2012, Eq. 2).

    It takes the lower envelope of each line by brute force, n² steps for n voxels, because the grid is small.
    """
    # Larger than any squared distance in the grid, and small enough to be exact in float32.
    squared = np.where(occupied, 0.0, 3.0 * (2.0 * LONGEST_SIDE) ** 2).astype(np.float32)
    for axis in range(3):
        lines = np.moveaxis(squared, axis, 0)
        best = lines.copy()
        for shift in range(1, lines.shape[0]):
            offset = np.float32(shift * shift)
            np.minimum(best[shift:], lines[:-shift] + offset, out=best[shift:])
            np.minimum(best[:-shift], lines[shift:] + offset, out=best[:-shift])
        squared = np.moveaxis(best, 0, axis)
    return np.ascontiguousarray(np.sqrt(squared))


def marched(
    space: FreeSpace, origins: Float64[np.ndarray, "n 3"], directions: Float64[np.ndarray, "m 3"]
) -> RayHits:
    """March rays from every origin (voxel units) along every unit direction; the result has shape [n, m]."""
    pairs = (len(origins), len(directions))
    hits = march_rays(space, np.repeat(origins, pairs[1], axis=0), np.tile(directions, (pairs[0], 1)))
    return RayHits(hits.hit.reshape(pairs), hits.distance.reshape(pairs), hits.voxel.reshape(pairs))


def march_rays(
    space: FreeSpace, origins: Float64[np.ndarray, "n 3"], directions: Float64[np.ndarray, "n 3"]
) -> RayHits:
    """Sphere-trace rays to the first occupied voxel (Hart 1996).

    Distances are accurate to about half a voxel. A ray that starts in an occupied voxel hits at distance 0.

    Args:
        space: the grid.
        origins: voxel units, inside or outside the grid.
        directions: unit vectors.
    """
    upper = np.array(space.shape, np.float64)
    occupied, clearance = space.occupied.ravel(), space.clearance.ravel()
    strides = np.array([space.shape[1] * space.shape[2], space.shape[2], 1], np.int64)
    enter, leave = _span_in_grid(origins, directions, upper)
    distance = np.full(len(origins), np.inf)
    voxel = np.full(len(origins), -1, np.int64)
    active = np.flatnonzero(enter < leave)
    travelled = enter[active]
    while active.size:
        position = origins[active] + travelled[:, None] * directions[active]
        index = np.clip(np.floor(position).astype(np.int64), 0, np.array(space.shape) - 1) @ strides
        arrived = occupied[index]
        distance[active[arrived]], voxel[active[arrived]] = travelled[arrived], index[arrived]
        # Clearance is between voxel centres. Position and surface may each be half a diagonal (√3/2) off.
        travelled = travelled + np.maximum(clearance[index] - np.sqrt(3.0), SHORTEST_STEP)
        going = ~arrived & (travelled < leave[active])
        active, travelled = active[going], travelled[going]
    return RayHits(np.isfinite(distance), distance, voxel)


def _span_in_grid(
    origins: Float64[np.ndarray, "n 3"],
    directions: Float64[np.ndarray, "n 3"],
    upper: Float64[np.ndarray, "3"],
) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]]:
    """Distances at which rays enter (0 or more) and leave the box from 0 to `upper`, by the slab test."""
    # Avoids a division by zero. A ray so nearly parallel to a slab leaves the grid through another one.
    steep = np.where(np.abs(directions) < 1e-9, np.copysign(1e-9, directions), directions)
    to_low, to_high = -origins / steep, (upper - origins) / steep
    enter = np.maximum(np.minimum(to_low, to_high).max(axis=1), 0.0)
    # No path through the box is longer than its diagonal. This also ends rays whose direction is zero.
    return enter, np.minimum(np.maximum(to_low, to_high).min(axis=1), enter + np.linalg.norm(upper))


def sphere_directions(count: int) -> Float64[np.ndarray, "count 3"]:
    """Unit directions spread evenly over the sphere, a Fibonacci lattice (Swinbank and Purser 2006)."""
    k = np.arange(count) + 0.5
    y = 1.0 - 2.0 * k / count
    azimuth = np.pi * (3.0 - np.sqrt(5.0)) * k
    radius = np.sqrt(1.0 - y * y)
    return np.stack([radius * np.cos(azimuth), y, radius * np.sin(azimuth)], axis=1)
