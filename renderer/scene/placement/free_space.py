"""Free space of a scene: an occupancy grid of its surfaces, a distance field, and ray marching through it.

Distances are in voxels and positions in voxel units from the grid's low corner. The grid of a scaled scene is
therefore the same, and so is every choice made from it.
"""

import functools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from vpltune.renderer.scene.placement.rasterised_surfaces import (
    DECIMALS,
    PlacedTriangles,
    placed_triangles,
    rasterised,
    spacing_within_budget,
)
from vpltune.renderer.scene.scene import Scene

# A choice: number of voxels in the scene's bounds.
VOXEL_BUDGET = 64**3
# A choice: most voxels along the longest side. An elongated scene gets fewer voxels because of it.
LONGEST_SIDE = 128
# A choice: empty voxels around the scene's bounds. The odd fraction keeps surfaces at round fractions of the
# bounds away from voxel faces.
MARGIN = 2.37
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
    albedo: Float32[np.ndarray, "nx ny nz 3"]
    """Area-weighted mean of the albedo in the voxel, linear; 0 in an empty voxel."""
    detail: Bool[np.ndarray, "nx ny nz"]
    """Whether the voxel holds an edge, a curve or small pieces, and not only plain surfaces."""

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
    return space_within(placed_triangles(scene), low, high)


def space_within(
    triangles: PlacedTriangles, low: Float64[np.ndarray, "3"], high: Float64[np.ndarray, "3"]
) -> FreeSpace:
    """The occupancy grid of the surfaces in the box from `low` to `high` (world units)."""
    extent = high - low
    size = float(extent.max()) or 1.0
    # Treat a flat scene as at least 1/64 as thick as it is long. Otherwise the voxels would shrink with it.
    volume = float(np.prod(np.maximum(extent / size, 1.0 / 64.0)))
    relative_voxel = max((volume / VOXEL_BUDGET) ** (1.0 / 3.0), 1.0 / LONGEST_SIDE)
    voxel = spacing_within_budget(triangles, size * relative_voxel)
    low_world = low - MARGIN * voxel
    shape = np.ceil(np.round(extent / voxel, DECIMALS) + 2.0 * MARGIN).astype(np.int64)
    area, normals, albedo, detail = rasterised(triangles, low_world, voxel, shape)
    clearance = _distance_to_occupied(area > 0.0)
    return FreeSpace(low_world, voxel, area > 0.0, clearance, area, normals, albedo, detail)


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
