"""An automatic spot light for a scene that has none, chosen by what it lights and what the camera sees.

In a room the light hangs high up inside. An object is lit from outside. Up is +Y.
"""

import dataclasses
import math

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.placement.bounced_light import bounce_score
from vpltune.renderer.scene.placement.free_places import CLEARANCE, PLACES, height_fraction, is_room
from vpltune.renderer.scene.placement.free_space import (
    FreeSpace,
    march_rays,
    marched,
    sphere_directions,
)
from vpltune.renderer.scene.placement.sight import (
    MIDDLE_RAYS,
    SAME_PLACE,
    Sight,
    frame_of,
    light_hits,
    march_from,
    mean_square_distance_world,
    seen_by,
)
from vpltune.renderer.scene.placement.subject import space_of_view
from vpltune.renderer.scene.scene import Camera, Light, Scene

# A choice: inner and outer half angle of the spot in a room, radians.
ROOM_CONE = (math.radians(35.0), math.radians(55.0))
# A choice: inner and outer half angle of the spot that lights an object, radians.
OBJECT_CONE = (math.radians(18.0), math.radians(27.0))
# A choice: directions on the sphere, of which those in the cone are used to score a spot.
CONE_DIRECTIONS = 512
# A choice: the best share of the image to light directly. The rest shows indirect light.
BEST_LIT = 0.45
# A choice: number of best spots whose bounced light is estimated.
FINALISTS = 20
# A choice: of five axes tried at a place outside, four miss the middle of the view by this share of the outer
# half angle.
MISS = 0.7
# A choice: a surface is overexposed if it is nearer to the light than this share of the RMS distance of all
# lit surfaces.
BURNT = 0.45
# A choice: irradiance in W/m² at the RMS distance of the lit surfaces, in each channel. A white diffuse
# surface there has a radiance of 1.
MEAN_IRRADIANCE = math.pi


def default_light(scene: Scene, camera: Camera) -> tuple[Light, str]:
    """A spot light that lights part of what the camera sees, and a sentence that says where it is and why.

    The choice depends on the scene and the camera only, and not on the scale of the scene.
    """
    space = space_of_view(scene, camera)
    sight = seen_by(space, camera)
    positions, axes, (inner_cone, outer_cone) = _light_candidates(space, camera, sight)
    scores, lit_shares = _spot_scores(space, sight, positions, axes, outer_cone)
    eye = space.to_voxels(camera.position_world)
    best, light, lit_share = -1.0, None, 0.0
    for flat in np.argsort(-np.round(scores, 9).ravel(), kind="stable")[:FINALISTS]:
        place, axis = divmod(int(flat), axes.shape[1])
        spot = _spot(space, space.to_world(positions[place]), axes[place, axis], inner_cone, outer_cone)
        # Rounded, so that rounding errors of a scaled scene do not decide between equal spots.
        score = round(float(scores[place, axis]) * bounce_score(space, sight, eye, spot), 6)
        if score > best:
            best, light, lit_share = score, spot, float(lit_shares[place, axis])
    assert light is not None
    place = ", ".join(f"{coordinate:.4g}" for coordinate in light.position_world)
    return light, (
        f"light chosen automatically: a {2.0 * math.degrees(outer_cone):.0f}° spot at ({place}); it lights"
        f" {100.0 * lit_share:.0f} % of what the camera sees, and the rest shows the indirect light"
    )


def _spot(
    space: FreeSpace,
    position_world: Float64[np.ndarray, "3"],
    direction_world: Float64[np.ndarray, "3"],
    inner_cone: float,
    outer_cone: float,
) -> Light:
    """A spot that gives `MEAN_IRRADIANCE` at the RMS distance of the surfaces that it lights."""
    dark = Light(
        "spot", np.zeros(3), position_world, direction_world, inner_cone, outer_cone, "automatic spot"
    )
    intensity = MEAN_IRRADIANCE * mean_square_distance_world(space, light_hits(space, dark))
    return dataclasses.replace(dark, intensity=np.full(3, intensity))


def _light_candidates(
    space: FreeSpace, camera: Camera, sight: Sight
) -> tuple[Float64[np.ndarray, "n 3"], Float64[np.ndarray, "n axes 3"], tuple[float, float]]:
    """Positions (voxel units), the axes to try at each, and the inner and outer half angle (radians)."""
    eye = space.to_voxels(camera.position_world)
    seen = sight.points[sight.hits.hit]
    center = np.median(seen, axis=0) if len(seen) else 0.5 * np.array(space.shape, np.float64)
    if is_room(space):
        positions = _places_in_view(space, eye, center)
        axes = [_tilted(0.0, 0.0)]
        axes += [_tilted(math.radians(40.0), azimuth) for azimuth in 2.0 * math.pi * np.arange(8) / 8]
        return positions, np.tile(np.array(axes), (len(positions), 1, 1)), ROOM_CONE
    positions = _places_around(space, eye, center)
    towards = center - positions
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    return positions, np.array([_axes_about(axis) for axis in towards]), OBJECT_CONE


def _axes_about(axis: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "axes 3"]:
    """The axis, and four that miss its target by `MISS`, so that the edge of the cone crosses the view."""
    u, v = frame_of(axis)
    miss = math.tan(MISS * OBJECT_CONE[1])
    axes = axis + miss * np.array([0.0 * u, u, -u, v, -v])
    return axes / np.linalg.norm(axes, axis=1, keepdims=True)


def _tilted(tilt: float, azimuth: float) -> Float64[np.ndarray, "3"]:
    """The unit vector at the angle `tilt` from straight down (radians)."""
    return np.array([math.sin(tilt) * math.cos(azimuth), -math.cos(tilt), math.sin(tilt) * math.sin(azimuth)])


def _places_in_view(
    space: FreeSpace, eye: Float64[np.ndarray, "3"], center: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, "n 3"]:
    """Free places visible from the eye and near to what it sees, high up in the room if possible."""
    index = np.argwhere(space.clearance >= CLEARANCE)
    positions = index[:: max(1, -(-len(index) // (2 * PLACES)))] + 0.5
    offset = positions - eye
    distance = np.linalg.norm(offset, axis=1)
    hits = march_from(space, eye, offset / np.maximum(distance, 1e-9)[:, None])
    in_sight = hits.distance > distance
    positions = positions[in_sight] if in_sight.any() else eye[None, :]
    fraction = height_fraction(space, positions)
    high = (fraction > 0.6) & (fraction < 0.93)
    if high.any():
        positions = positions[high]
    near = np.argsort(np.round(np.linalg.norm(positions - center, axis=1), 6), kind="stable")
    near = near[: max(160, len(near) // 3)]
    return positions[near[:: max(1, len(near) // 80)]]


def _places_around(
    space: FreeSpace, eye: Float64[np.ndarray, "3"], center: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, "n 3"]:
    """Places outside and above an object, to both sides of the camera's view, 0.8 grid diagonals away."""
    reach = 0.8 * float(np.linalg.norm(space.shape))
    back = eye - center
    azimuth = math.atan2(back[0], back[2])
    return np.array(
        [
            center
            + reach
            * np.array(
                [
                    math.cos(elevation) * math.sin(azimuth + turn),
                    math.sin(elevation),
                    math.cos(elevation) * math.cos(azimuth + turn),
                ]
            )
            for turn in np.radians([45.0, -45.0, 80.0, -80.0, 120.0, -120.0])
            for elevation in np.radians([20.0, 35.0, 50.0])
        ]
    )


def _spot_scores(
    space: FreeSpace,
    sight: Sight,
    positions: Float64[np.ndarray, "n 3"],
    axes: Float64[np.ndarray, "n axes 3"],
    outer_cone: float,
) -> tuple[Float64[np.ndarray, "n axes"], Float64[np.ndarray, "n axes"]]:
    """Score of the spot at each position along each axis, and the share of the image that it lights.

    The score is a product. Its factors favour a cone that hits surfaces, none of them so close that they are
    overexposed, a directly lit share of the image near `BEST_LIT`, and a lit middle of the image.
    """
    directions = sphere_directions(CONE_DIRECTIONS)
    around = marched(space, positions, directions)
    in_cone = (axes @ directions.T > math.cos(outer_cone)).astype(np.float64)
    square = np.where(around.hit, around.distance, 0.0) ** 2
    count = in_cone.sum(axis=2)
    hits = np.einsum("nad,nd->na", in_cone, around.hit.astype(np.float64))
    mean_square = np.einsum("nad,nd->na", in_cone, square) / np.maximum(hits, 1.0)
    burnt = around.hit[:, None, :] & (square[:, None, :] < BURNT**2 * mean_square[:, :, None])
    burnt_share = (in_cone * burnt).sum(axis=2) / np.maximum(hits, 1.0)
    seen, in_middle = sight.points[sight.hits.hit], np.zeros(len(sight.points), bool)
    in_middle[MIDDLE_RAYS] = True
    lit_share = _lit_shares(space, seen[::4], positions, axes, outer_cone)
    middle_share = _lit_shares(space, sight.points[in_middle & sight.hits.hit], positions, axes, outer_cone)
    wanted = np.exp(-(((lit_share - BEST_LIT) / 0.2) ** 2))
    # The constants keep every score above zero, so the least bad spot wins if none is good.
    score = (
        (hits / count) * (1.0 - burnt_share) ** 2 * (0.02 + wanted) * (0.3 + np.minimum(middle_share, 0.7))
    )
    return score, lit_share


def _lit_shares(
    space: FreeSpace,
    points: Float64[np.ndarray, "points 3"],
    positions: Float64[np.ndarray, "n 3"],
    axes: Float64[np.ndarray, "n axes 3"],
    outer_cone: float,
) -> Float64[np.ndarray, "n axes"]:
    """Share of the surface points that a spot lights, for each position and each of its axes."""
    if not len(points):
        return np.zeros(axes.shape[:2])
    offset = points[None, :, :] - positions[:, None, :]
    distance = np.linalg.norm(offset, axis=2)
    towards = offset / np.maximum(distance, 1e-9)[:, :, None]
    origins = np.repeat(positions, len(points), axis=0)
    reached = march_rays(space, origins, towards.reshape(-1, 3)).distance >= distance.ravel() - SAME_PLACE
    in_cone = axes @ towards.transpose(0, 2, 1) > math.cos(outer_cone)
    return (in_cone & reached.reshape(distance.shape)[:, None, :]).mean(axis=2)
