"""What a camera sees and what a light reaches, estimated by ray marching through the occupancy grid."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from vpltune.renderer.scene.placement.free_space import FreeSpace, RayHits, march_rays
from vpltune.renderer.scene.scene import Camera, Light

# A choice: rays of one image, columns by rows (4:3).
IMAGE = (40, 30)
# Flat indices of the rays in the middle third of the image, horizontally and vertically.
MIDDLE_RAYS = np.arange(IMAGE[0] * IMAGE[1]).reshape(IMAGE[1], IMAGE[0])[10:20, 13:27].ravel()
# A choice: rays of one spot or point light. A directional light has four times as many.
LIGHT_RAYS = 1024
# A choice: hits closer together than this, in voxels, count as the same place. Both ends of a marched
# distance are accurate to about half a voxel.
SAME_PLACE = 1.8
# A choice: distance in voxels that a ray skips first if it starts in an occupied voxel.
LEAVE_WALL = 1.8
# A choice: a ray hits a back face if the cosine between it and the voxel's mean normal is at least this.
BACK_FACE = 0.05


@dataclass(frozen=True, eq=False)
class Sight:
    """What the rays of one camera hit."""

    hits: RayHits
    points: Float64[np.ndarray, "rays 3"]
    """Hit points in voxel units; undefined where `hits.hit` is false."""

    @property
    def hit_fraction(self) -> float:
        """Share of the rays that hit a surface, in [0, 1]."""
        return float(self.hits.hit.mean())

    def depth(self) -> float:
        """Median distance of the visible surfaces in voxels; 0 if none is visible."""
        return float(np.median(self.hits.distance[self.hits.hit])) if self.hits.hit.any() else 0.0


def image_directions(camera: Camera, columns_rows: tuple[int, int] = IMAGE) -> Float64[np.ndarray, "rays 3"]:
    """Unit directions in world space through the pixel centres of a coarse image, row by row from the top."""
    columns, rows = columns_rows
    tan_half = math.tan(0.5 * camera.yfov)
    x = (2.0 * (np.arange(columns) + 0.5) / columns - 1.0) * tan_half * columns / rows
    y = (1.0 - 2.0 * (np.arange(rows) + 0.5) / rows) * tan_half
    grid = np.stack(np.broadcast_arrays(x[None, :], y[:, None], -1.0), axis=-1).reshape(-1, 3)
    grid /= np.linalg.norm(grid, axis=1, keepdims=True)
    return grid @ camera.to_world[:3, :3].T


def seen_by(space: FreeSpace, camera: Camera) -> Sight:
    """What the camera sees in a 4:3 image."""
    directions = image_directions(camera)
    origin = space.to_voxels(camera.position_world)
    hits = march_from(space, origin, directions)
    return Sight(hits, origin + np.where(hits.hit, hits.distance, 0.0)[:, None] * directions)


def march_from(
    space: FreeSpace, place: Float64[np.ndarray, "3"], directions: Float64[np.ndarray, "rays 3"]
) -> RayHits:
    """March rays from one camera or light at `place` (voxel units) along unit directions.

    If the voxel of `place` is occupied, the rays skip the first `LEAVE_WALL` voxels.
    """
    lead = LEAVE_WALL if space.clearance_at(place[None, :])[0] == 0.0 else 0.0
    hits = march_rays(space, place + lead * directions, directions)
    return RayHits(hits.hit, hits.distance + lead, hits.voxel)


def front_facing(
    space: FreeSpace, voxel: Int64[np.ndarray, "*rays"], directions: Float64[np.ndarray, "*rays 3"]
) -> Bool[np.ndarray, "*rays"]:
    """Whether rays hit front faces in the given voxels. True if a voxel holds faces of both orientations."""
    normals = space.normals.reshape(-1, 3)[voxel]
    return (normals * directions).sum(axis=-1) < BACK_FACE


def cone_directions(
    axis: Float64[np.ndarray, "3"], outer_cone: float, count: int
) -> Float64[np.ndarray, "count 3"]:
    """Unit directions spread evenly over a cone, a Fibonacci lattice on its spherical cap.

    Args:
        axis: unit vector.
        outer_cone: half angle of the cone in radians.
        count: number of directions.
    """
    k = np.arange(count) + 0.5
    cosine = 1.0 - k / count * (1.0 - math.cos(outer_cone))
    azimuth = math.pi * (3.0 - math.sqrt(5.0)) * k
    sine = np.sqrt(np.maximum(0.0, 1.0 - cosine**2))
    u, v = frame_of(axis)
    return (
        cosine[:, None] * axis + (sine * np.cos(azimuth))[:, None] * u + (sine * np.sin(azimuth))[:, None] * v
    )


def frame_of(axis: Float64[np.ndarray, "3"]) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
    """Two unit vectors perpendicular to a unit axis and to each other."""
    helper = np.eye(3)[np.argmin(np.round(np.abs(axis), 6))]
    u = np.cross(axis, helper)
    u /= np.linalg.norm(u)
    return u, np.cross(axis, u)


def light_hits(space: FreeSpace, light: Light) -> RayHits:
    """The first hits of a light's rays. A directional light's start outside and cover the whole grid."""
    if light.kind == "directional":
        size = float(np.linalg.norm(space.shape))
        u, v = frame_of(light.direction_world)
        side = math.isqrt(4 * LIGHT_RAYS)
        step = size * ((np.arange(side) + 0.5) / side - 0.5)
        start = 0.5 * np.array(space.shape, np.float64) - size * light.direction_world
        origins = (start + step[:, None, None] * u + step[None, :, None] * v).reshape(-1, 3)
        return march_rays(space, origins, np.tile(light.direction_world, (len(origins), 1)))
    outer = light.outer_cone if light.kind == "spot" else math.pi
    directions = cone_directions(light.direction_world, outer, LIGHT_RAYS)
    return march_from(space, space.to_voxels(light.position_world), directions)


def lit(space: FreeSpace, light: Light, points: Float64[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
    """Which surface points (voxel units, accurate to half a voxel) the light reaches directly."""
    if light.kind == "directional":
        # March towards the points from outside the grid, so no ray starts on a surface.
        distance = np.full(len(points), 2.0 * float(np.linalg.norm(space.shape)))
        towards = np.tile(light.direction_world, (len(points), 1))
        hits = march_rays(space, points - distance[:, None] * towards, towards)
    else:
        place = space.to_voxels(light.position_world)
        offset = points - place
        distance = np.linalg.norm(offset, axis=1)
        towards = offset / np.maximum(distance, 1e-9)[:, None]
        hits = march_from(space, place, towards)
    reached = hits.distance >= distance - SAME_PLACE
    if light.kind != "directional":
        reached &= distance < light.range / space.voxel_world
    if light.kind == "spot":
        reached &= towards @ light.direction_world > math.cos(light.outer_cone)
    return reached


def lit_fraction(space: FreeSpace, sight: Sight, lights: tuple[Light, ...]) -> float:
    """Share of an image's visible surface points that any of the lights reaches directly, in [0, 1]."""
    points = sight.points[sight.hits.hit]
    if not len(points):
        return 0.0
    return float(
        np.any([np.zeros(len(points), bool), *(lit(space, light, points) for light in lights)], axis=0).mean()
    )


def mean_square_distance_world(space: FreeSpace, hits: RayHits) -> float:
    """Mean squared distance of the hits in world units squared; 0 if there are none."""
    distance = hits.distance[hits.hit]
    return float((distance**2).mean()) * space.voxel_world**2 if distance.size else 0.0
