"""How well one bounce of a spot's light shows in what a camera sees, estimated in the occupancy grid."""

import math

import numpy as np
from jaxtyping import Bool, Float64, Int64

from vpltune.renderer.files.srgb import LUMINANCE
from vpltune.renderer.scene.placement.free_space import FreeSpace, march_rays
from vpltune.renderer.scene.placement.sight import SAME_PLACE, Sight, cone_directions, lit, march_from
from vpltune.renderer.scene.scene import Light

# A choice: most surface points that emit, and most that receive.
EMITTERS, RECEIVERS = 48, 64
# A choice: bounced radiance that counts as visible, where directly lit white has 1.
VISIBLE_RADIANCE = 0.03
# A choice: distance in voxels from a surface at which a shadow ray starts.
LEAVE_SURFACE = 1.5
# A choice: weights of visible and of coloured light if there is none, so that no score is zero.
LEAST_VISIBLE, LEAST_COLORED = 0.1, 0.2


def bounce_score(space: FreeSpace, sight: Sight, eye: Float64[np.ndarray, "3"], light: Light) -> float:
    """Score of a spot: how visible its bounced light is where it does not shine itself, and how coloured.

    Args:
        space: the scene's grid.
        sight: what the camera sees.
        eye: the camera's position in voxel units.
        light: a spot; its intensity does not matter.
    """
    seen = sight.hits.hit
    points, voxels = sight.points[seen][::4], sight.hits.voxel[seen][::4]
    dark = ~lit(space, light, points) if len(points) else np.zeros(0, bool)
    if not dark.any():
        return LEAST_VISIBLE * LEAST_COLORED
    points, voxels = points[dark], voxels[dark]
    step = -(-len(points) // RECEIVERS)
    points, voxels = points[::step], voxels[::step]
    irradiance = _irradiance(space, light, points, _normals_towards(space, voxels, eye - points))
    albedo = space.albedo.reshape(-1, 3)[voxels]
    visible = np.minimum((albedo * irradiance / math.pi) @ LUMINANCE / VISIBLE_RADIANCE, 1.0)
    colored = np.ptp(irradiance, axis=1) / np.maximum(irradiance.max(axis=1), 1e-9)
    return (LEAST_VISIBLE + float(visible.mean())) * (LEAST_COLORED + float((visible * colored).mean()))


def _irradiance(
    space: FreeSpace,
    light: Light,
    points: Float64[np.ndarray, "receivers 3"],
    normals: Float64[np.ndarray, "receivers 3"],
) -> Float64[np.ndarray, "receivers 3"]:
    """Irradiance after one bounce, for a spot that gives π at the RMS distance of what it lights.

    Each emitter is a disc: Φ/π · cosθ · cosθ′ / (d² + ℓ²), as in the runtime.
    """
    place = space.to_voxels(light.position_world)
    directions = cone_directions(light.direction_world, light.outer_cone, EMITTERS)
    hits = march_from(space, place, directions)
    if not hits.hit.any():
        return np.zeros_like(points)
    distance, towards, voxels = hits.distance[hits.hit], directions[hits.hit], hits.voxel[hits.hit]
    emitters = place + distance[:, None] * towards
    emitter_normals = _normals_towards(space, voxels, -towards)
    solid_angle = 2.0 * math.pi * (1.0 - math.cos(light.outer_cone)) / EMITTERS
    flux = math.pi * float((distance**2).mean()) * solid_angle * space.albedo.reshape(-1, 3)[voxels]
    offset = emitters[None] - points[:, None]
    square = (offset**2).sum(axis=2)
    unit = offset / np.sqrt(np.maximum(square, 1e-9))[:, :, None]
    cosine = np.maximum(np.einsum("rec,rc->re", unit, normals), 0.0)
    cosine *= np.maximum(-np.einsum("rec,ec->re", unit, emitter_normals), 0.0)
    form = cosine / (math.pi * (square + solid_angle * distance**2 / math.pi))
    return (form * _unobstructed(space, points, normals, emitters)) @ flux


def _unobstructed(
    space: FreeSpace,
    points: Float64[np.ndarray, "receivers 3"],
    normals: Float64[np.ndarray, "receivers 3"],
    emitters: Float64[np.ndarray, "emitters 3"],
) -> Bool[np.ndarray, "receivers emitters"]:
    origins = np.repeat(points + LEAVE_SURFACE * normals, len(emitters), axis=0)
    offset = np.tile(emitters, (len(points), 1)) - origins
    distance = np.linalg.norm(offset, axis=1)
    reached = march_rays(space, origins, offset / np.maximum(distance, 1e-9)[:, None]).distance
    return (reached >= distance - SAME_PLACE).reshape(len(points), len(emitters))


def _normals_towards(
    space: FreeSpace, voxels: Int64[np.ndarray, " n"], towards: Float64[np.ndarray, "n 3"]
) -> Float64[np.ndarray, "n 3"]:
    """Unit normals of voxels, turned to the side of `towards`; `towards` itself where they cancel."""
    normals = space.normals.reshape(-1, 3)[voxels].astype(np.float64)
    plain = np.linalg.norm(normals, axis=1) > 0.5
    chosen = np.where(plain[:, None], normals, towards)
    chosen /= np.maximum(np.linalg.norm(chosen, axis=1, keepdims=True), 1e-9)
    side = np.where((chosen * towards).sum(axis=1) < 0.0, -1.0, 1.0)
    return chosen * side[:, None]
