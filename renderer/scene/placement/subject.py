"""The subject of a scene: where its detail is, and a grid about it where the scene is much larger.

A house on a plain of 2 km would be one voxel of the scene's own grid. Detail is what is not plain
(`FreeSpace.detail`): edges, curves and thin pieces, but no ground, however large.
"""

import functools

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.placement.free_space import FreeSpace, free_space, space_within
from vpltune.renderer.scene.placement.rasterised_surfaces import placed_triangles, triangles_in_box
from vpltune.renderer.scene.scene import Camera, Scene

# A choice: the subject gets a grid of its own if its detail takes less than this share of the grid's longest
# side.
SMALL_SUBJECT = 0.3
# A choice: share of the detail at either end of each axis that does not count, so that one stray piece cannot
# make the subject large.
STRAY = 0.02
# A choice: a grid about the subject is larger than its detail by this factor, so that some ground shows.
SURROUNDINGS = 2.0
# A choice: least height of that grid as a share of its width.
LEAST_HEIGHT = 0.3
# A choice: most grids after the scene's own, each about the subject of the one before.
MOST_GRIDS = 4


@functools.lru_cache(maxsize=1)
def subject_space(scene: Scene) -> FreeSpace:
    """The grid in which views are placed: of the whole scene, or about a subject much smaller than that.

    The grid of the last scene is cached.
    """
    space, triangles = free_space(scene), None
    for _ in range(MOST_GRIDS):
        low, high = detail_bounds(space)
        longest = float((high - low).max())
        if longest >= SMALL_SUBJECT * max(space.shape):
            break
        center, extent = 0.5 * (low + high), SURROUNDINGS * (high - low)
        extent = np.maximum(extent, LEAST_HEIGHT * SURROUNDINGS * longest)
        low_world, high_world = space.to_world(center - 0.5 * extent), space.to_world(center + 0.5 * extent)
        triangles = placed_triangles(scene) if triangles is None else triangles
        space = space_within(triangles_in_box(triangles, low_world, high_world), low_world, high_world)
    return space


def space_of_view(scene: Scene, camera: Camera) -> FreeSpace:
    """The grid of the subject if the camera is within a diagonal of its middle, else that of the scene."""
    space = subject_space(scene)
    from_middle = space.to_voxels(camera.position_world) - 0.5 * np.array(space.shape, np.float64)
    return space if np.linalg.norm(from_middle) < np.linalg.norm(space.shape) else free_space(scene)


def detail_bounds(space: FreeSpace) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
    """Low and high corner of the scene's detail in voxel units, without stray pieces.

    Without any detail, those of all its surfaces.
    """
    index = _pieces(space)
    # Not interpolated: between two lone pieces, neither would be within the bounds.
    low = np.quantile(index, STRAY, axis=0, method="lower")
    return low, np.quantile(index, 1.0 - STRAY, axis=0, method="higher") + 1.0


def subject_pieces(space: FreeSpace) -> Float64[np.ndarray, "pieces 3"]:
    """Centres of the voxels within `detail_bounds` that it counts, in voxel units; at least one."""
    low, high = detail_bounds(space)
    centers = _pieces(space) + 0.5
    return centers[((centers >= low) & (centers <= high)).all(axis=1)]


def _pieces(space: FreeSpace) -> Float64[np.ndarray, "pieces 3"]:
    return np.argwhere(space.detail if space.detail.any() else space.occupied).astype(np.float64)
