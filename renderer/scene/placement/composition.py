"""How good a picture a camera would take, judged by the surfaces that the rays of a coarse image hit.

A composition is good if it shows many surfaces and none that fills the image, little background, variety of
depth, and nothing close to the camera or seen from behind.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from vpltune.renderer.scene.placement.free_space import FreeSpace
from vpltune.renderer.scene.placement.sight import MIDDLE_RAYS, Sight, front_facing, seen_by
from vpltune.renderer.scene.scene import Camera

# Choices: size in voxels of the pieces that detail is counted in, and by which planes are told apart.
PIECE, PLANE = 6.0, 4.0
# A choice: steps by which normals and albedo are told apart.
NORMAL_STEP, ALBEDO_STEP = 0.5, 0.25
# A choice: a composition gains nothing from more surfaces than this.
ENOUGH_SURFACES = 16.0


@dataclass(frozen=True)
class Composition:
    """What an image shows; shares are of its rays."""

    hit: float
    """Share that hits a surface."""
    front: float
    """Share that hits a front face."""
    near: float
    """Share that hits a surface so near that it obstructs the view."""
    detail: float
    """Share that hits detail (`FreeSpace.detail`)."""
    surfaces: float
    """Effective number of surfaces: exp of the entropy of their shares of the rays that hit."""
    largest: float
    """Share of the largest surface."""
    spread: float
    """Standard deviation of log distance."""
    area: float
    """Square root of the mean area that a ray sees, in voxels."""
    depth_ahead: float
    """Mean distance in the middle of the image, relative to the median distance."""


def composition(space: FreeSpace, camera: Camera, near: float) -> Composition:
    """What the camera's 4:3 image shows; a surface nearer than `near` (voxels) obstructs the view."""
    sight = seen_by(space, camera)
    hit = sight.hits.hit
    if not hit.any():
        return Composition(0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    distance, voxel = sight.hits.distance[hit], sight.hits.voxel[hit]
    rays = (sight.points[hit] - space.to_voxels(camera.position_world)) / np.maximum(distance, 1e-6)[:, None]
    front = front_facing(space, voxel, rays)
    normals = space.normals.reshape(-1, 3)[voxel]
    # Area per ray is d²/cos θ. The bound on cos θ keeps a floor at a grazing angle from dominating the score.
    tilt = np.maximum(np.abs((normals * rays).sum(axis=1)), 0.3)
    shares = _surface_shares(space, sight)
    middle = sight.hits.distance[MIDDLE_RAYS]
    return Composition(
        hit=sight.hit_fraction,
        front=float(front.sum()) / hit.size,
        near=float((distance < near).sum()) / hit.size,
        detail=float(space.detail.ravel()[voxel].sum()) / hit.size,
        surfaces=float(np.exp(-(shares * np.log(shares)).sum())),
        largest=sight.hit_fraction * float(shares.max()),
        spread=float(np.std(np.log(np.maximum(distance, 0.5)))),
        area=float(np.sqrt(np.where(front, distance**2 / tilt, 0.0).sum() / hit.size)),
        depth_ahead=float(np.where(np.isfinite(middle), middle, 0.0).mean() / np.median(distance)),
    )


def _surface_shares(space: FreeSpace, sight: Sight) -> Float64[np.ndarray, " surfaces"]:
    """Share of the hits on each surface: planes, and pieces of detail, told apart by albedo too."""
    hit = sight.hits.hit
    voxel = sight.hits.voxel[hit]
    # Centres of the voxels, which on an axis-aligned plane do not vary as the hit points do.
    points = np.stack(np.unravel_index(voxel, space.shape), axis=1) + 0.5
    normals = space.normals.reshape(-1, 3)[voxel].astype(np.float64)
    albedo = space.albedo.reshape(-1, 3)[voxel].astype(np.float64)
    detail = space.detail.ravel()[voxel]
    facing = np.round(normals / NORMAL_STEP)
    place = np.where(
        detail[:, None],
        np.floor(points / PIECE),
        (np.round((facing * NORMAL_STEP * points).sum(axis=1) / PLANE))[:, None] * [1.0, 0.0, 0.0],
    )
    facing[detail] = 0.0
    labels: Int64[np.ndarray, "rays 9"] = np.concatenate(
        [facing, place, np.floor(albedo / ALBEDO_STEP)], axis=1
    ).astype(np.int64)
    _, counts = np.unique(labels, axis=0, return_counts=True)
    return counts / counts.sum()
