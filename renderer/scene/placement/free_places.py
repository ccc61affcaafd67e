"""Free places spread over a scene, what is visible from them, and whether the scene is a room."""

import functools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from vpltune.renderer.scene.placement.free_space import FreeSpace, march_rays, marched, sphere_directions
from vpltune.renderer.scene.placement.sight import front_facing

# A choice: smallest distance between a camera or light and the nearest occupied voxel, in voxels.
CLEARANCE = 2.0
# A choice: most places in a scene.
PLACES = 1200
# A choice: directions in which rays are marched from each place.
PLACE_DIRECTIONS = 256
# Choices: a place is walled in if at least this share of its directions hits a surface, and at least this
# share of those hits a front face.
WALLED_IN, FROM_FRONT = 0.85, 0.7
# A scene is a room if at least this share of its free places is walled in. Measured: 0.04 to 0.9 in ten
# rooms, levels and courtyards; 0.00 to 0.01 in five objects, one of them a hollow tower.
ROOM_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class Places:
    """Free places spread over the grid, and what is visible from each along `PLACE_DIRECTIONS` directions."""

    positions: Float64[np.ndarray, "places 3"]
    """Voxel units."""
    distance: Float64[np.ndarray, "places directions"]
    """Distance to the surface hit in voxels; 0 if none is hit."""
    hit: Bool[np.ndarray, "places directions"]
    """Whether a surface is hit."""
    front: Bool[np.ndarray, "places directions"]
    """Whether a front face is hit."""
    detail: Bool[np.ndarray, "places directions"]
    """Whether what is hit is not plain (`FreeSpace.detail`)."""

    def walled_in(self) -> Bool[np.ndarray, " places"]:
        """Which places have surfaces nearly all around, most of them facing the place."""
        hits = self.hit.sum(axis=1)
        return (hits >= WALLED_IN * self.hit.shape[1]) & (self.front.sum(axis=1) >= FROM_FRONT * hits)

    def reach(self) -> Float64[np.ndarray, " places"]:
        """Distance in voxels that nine in ten directions do not exceed; one without a hit has 0."""
        return np.quantile(self.distance, 0.9, axis=1)

    def share_walled_in(self) -> float:
        """Share of the places that are walled in, in [0, 1]; 0 if there are no places."""
        return float(self.walled_in().mean()) if len(self.positions) else 0.0


@functools.lru_cache(maxsize=1)
def free_places(space: FreeSpace) -> Places:
    """Up to `PLACES` centres of voxels with enough clearance, evenly spaced in voxel order.

    The result for the last grid is cached.
    """
    index = np.argwhere(space.clearance >= CLEARANCE)
    positions = index[:: max(1, -(-len(index) // PLACES))] + 0.5
    directions = sphere_directions(PLACE_DIRECTIONS)
    hits = marched(space, positions, directions)
    front = hits.hit & front_facing(space, hits.voxel, np.broadcast_to(directions, (*hits.hit.shape, 3)))
    detail = hits.hit & space.detail.ravel()[hits.voxel]
    return Places(positions, np.where(hits.hit, hits.distance, 0.0), hits.hit, front, detail)


def is_room(space: FreeSpace) -> bool:
    """Whether the scene is a room (or several) rather than an object: enough free space is walled in."""
    return free_places(space).share_walled_in() >= ROOM_SHARE


def height_fraction(space: FreeSpace, positions: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, " n"]:
    """Height above the floor as a share of the room height, in [0, 1]; 0 if there is no floor below.

    If there is no ceiling above, the top of the grid takes its place.

    Args:
        space: the scene's grid.
        positions: voxel units.
    """
    up = np.tile([0.0, 1.0, 0.0], (len(positions), 1))
    below = march_rays(space, positions, -up).distance
    above = march_rays(space, positions, up).distance
    above = np.where(np.isfinite(above), above, np.maximum(space.shape[1] - positions[:, 1], 0.5))
    return np.where(np.isfinite(below), 1.0 / (1.0 + above / np.maximum(below, 0.5)), 0.0)
