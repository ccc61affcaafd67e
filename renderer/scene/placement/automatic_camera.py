"""An automatic camera for a scene that has none, chosen by what it shows (`composition`).

In a room, the camera stands inside, or in front of the open side if there is one. Any other scene counts as
an object, which the camera looks at from outside. Where the subject is much smaller than the scene, as a
house on a plain, the subject alone counts. Up is +Y, as in glTF.
"""

import math

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.placement.composition import (
    ENOUGH_SURFACES,
    Composition,
    composition,
)
from vpltune.renderer.scene.placement.free_places import (
    FROM_FRONT,
    PLACE_DIRECTIONS,
    Places,
    free_places,
    height_fraction,
    is_room,
)
from vpltune.renderer.scene.placement.free_space import FreeSpace, sphere_directions
from vpltune.renderer.scene.placement.sight import front_facing, lit_fraction, seen_by
from vpltune.renderer.scene.placement.subject import detail_bounds, subject_pieces, subject_space
from vpltune.renderer.scene.scene import Camera, Light, Scene
from vpltune.renderer.scene.transforms import look_at

# A choice: vertical field of view inside a room, radians.
YFOV = math.radians(62.0)
# A choice: vertical field of view of a camera that looks at an object or into an open side, radians.
OBJECT_YFOV = math.radians(40.0)
# A choice: number of best views that are scored again with the rays of a whole image.
FINALISTS = 48
# A choice: a side of a room is open if at least this share of the rays through it hit a surface, at a median
# depth of at least this share of the room.
OPENING_HITS, OPENING_DEPTH = 0.95, 0.4
# Choices: a surface obstructs the view if it is nearer than this share of the place's `Places.reach`, or,
# outside, of the grid's diagonal.
NEAR_INSIDE, NEAR_OUTSIDE = 0.35, 0.12
# Choices: inside, a view with this share of detail is as good as with more; the other number keeps a view
# without any from scoring zero.
ENOUGH_DETAIL, LEAST_DETAIL = 0.25, 0.1
# A choice: a surface may fill this share of the image without a penalty.
LARGEST = 0.35
# Choices: elevations in degrees and number of azimuths of the cameras around an object.
ELEVATIONS, AZIMUTHS = (4.0, 14.0, 28.0, 44.0), 8
# A choice: a camera gains nothing from a directly lit share of the image beyond this.
ENOUGH_LIT = 0.45


def default_camera(scene: Scene) -> tuple[Camera, str]:
    """A camera that shows much of the scene, and a sentence that says where it stands and why.

    The choice depends on the scene only, and not on its scale.
    """
    candidates, where = _cameras(subject_space(scene))
    camera = max(candidates, key=lambda candidate: candidate[0])[1]
    return camera, _camera_note(camera, where)


def default_camera_for_lights(scene: Scene, lights: tuple[Light, ...]) -> tuple[Camera, str]:
    """Like `default_camera`, but also prefers views in which these lights light much of the image."""
    space = subject_space(scene)
    candidates, where = _cameras(space)
    shares = [lit_fraction(space, seen_by(space, camera), lights) for _, camera in candidates]
    # Half the lit share weighs as much as half the score. Rounding keeps ties independent of scene scale.
    scores = [
        round(score * min(share, ENOUGH_LIT), 9) for (score, _), share in zip(candidates, shares, strict=True)
    ]
    best = int(np.argmax(scores))
    camera = candidates[best][1]
    reached = f"the given light reaches {100.0 * shares[best]:.0f} % of what it sees"
    return camera, f"{_camera_note(camera, where)}; {reached}"


def _camera_note(camera: Camera, where: str) -> str:
    eye = ", ".join(f"{coordinate:.4g}" for coordinate in camera.position_world)
    degrees = math.degrees(camera.yfov)
    return (
        f"camera chosen automatically: {where}, at ({eye}), with a vertical field of view of {degrees:.0f}°"
    )


def _cameras(space: FreeSpace) -> tuple[list[tuple[float, Camera]], str]:
    """Candidate cameras with their scores, and a description of where they stand."""
    if not is_room(space):
        return _cameras_outside(space), "outside, in a three-quarter view of the subject"
    before_opening = _cameras_before_openings(space)
    if before_opening:
        return before_opening, "in front of the open side, looking in"
    return _cameras_inside(space, free_places(space)), "inside, where it sees much of the scene"


def _cameras_inside(space: FreeSpace, places: Places) -> list[tuple[float, Camera]]:
    """The `FINALISTS` best level and slightly lowered views from the free places.

    The score is a product. Its factors favour rays that hit surfaces from the front, large and varied depth,
    nothing close to the camera, a walled-in place and eye height. The finalists are then scored again with
    the rays of a whole image.
    """
    looks, inside = _looks()
    count = inside.sum(axis=1)
    hit_share = places.hit @ inside.T / count
    front_share = places.front @ inside.T / count
    depth = np.maximum(places.distance, 0.5)
    hits = np.maximum(places.hit @ inside.T, 1.0)
    log_depth = np.where(places.hit, np.log(depth), 0.0)
    mean_log = log_depth @ inside.T / hits
    spread = np.sqrt(np.maximum(log_depth**2 @ inside.T / hits - mean_log**2, 0.0))
    # Square root of the visible area, if every surface faced the camera.
    area = np.sqrt(np.where(places.front, depth**2, 0.0) @ inside.T / count)
    near_distance = NEAR_INSIDE * places.reach()
    near = (places.hit & (places.distance < near_distance[:, None])) @ inside.T / count
    detail = places.detail @ inside.T / count
    # A place surrounded by front faces is in a room. A fifth of the directions may be open without penalty,
    # as in a box without a front wall.
    indoors = np.minimum(places.front.mean(axis=1) / 0.8, 1.0) ** 4
    place_weight = indoors * _eye_height_weight(space, places.positions)
    # An area weighs less in a large room, or an empty hall would win over a furnished room.
    place_weight /= np.maximum(places.reach(), 1.0) ** 0.25
    score = (
        hit_share**3
        * (0.05 + front_share**2)
        * np.sqrt(area)
        * (LEAST_DETAIL + np.minimum(detail, ENOUGH_DETAIL))
        * (1.0 + np.minimum(spread, 0.5))
        * (1.0 - near) ** 3
        * place_weight[:, None]
    )
    best = np.argsort(-np.round(score, 9).ravel(), kind="stable")[:FINALISTS]
    finalists = []
    for flat in best:
        place, look = divmod(int(flat), len(looks))
        eye = space.to_world(places.positions[place])
        camera = Camera(look_at(eye, eye + space.voxel_world * looks[look]), YFOV)
        seen = composition(space, camera, float(near_distance[place]))
        finalists.append((_rounded(_indoor_score(seen) * float(place_weight[place])), camera))
    return finalists


def _looks() -> tuple[Float64[np.ndarray, "looks 3"], Float64[np.ndarray, "looks directions"]]:
    """View directions all around, and for each a mask (0 or 1) of the sphere directions in its 4:3 image."""
    directions = sphere_directions(PLACE_DIRECTIONS)
    looks, inside = [], []
    for pitch in np.radians([-4.0, -16.0]):
        for azimuth in 2.0 * math.pi * np.arange(24) / 24:
            look = np.array(
                [math.cos(pitch) * math.sin(azimuth), math.sin(pitch), -math.cos(pitch) * math.cos(azimuth)]
            )
            local = directions @ look_at(np.zeros(3), look)[:3, :3]
            tangent = local[:, :2] / np.maximum(-local[:, 2:], 1e-6)
            limit = math.tan(0.5 * YFOV)
            ahead = local[:, 2] < 0.0
            inside.append(
                ahead & (np.abs(tangent[:, 0]) < limit * 4.0 / 3.0) & (np.abs(tangent[:, 1]) < limit)
            )
            looks.append(look)
    return np.array(looks), np.array(inside, np.float64)


def _indoor_score(seen: Composition) -> float:
    """Score of an image inside a room: much visible area, many surfaces, and a view into the depth."""
    return (
        seen.hit**3
        * math.sqrt(seen.area)
        * _surface_score(seen)
        * (LEAST_DETAIL + min(seen.detail, ENOUGH_DETAIL))
        * (1.0 + min(seen.spread, 0.5))
        * (1.0 - seen.near) ** 3
        * min(max(seen.depth_ahead, 0.5), 1.4)
    )


def _without_excess(largest: float) -> float:
    """1 for a largest surface up to `LARGEST`, falling to 0 where it fills the image."""
    return min((1.0 - largest) / (1.0 - LARGEST), 1.0)


def _surface_score(seen: Composition) -> float:
    """Score for many surfaces of which none fills the image."""
    return math.sqrt(min(seen.surfaces, ENOUGH_SURFACES)) * _without_excess(seen.largest) ** 2


def _eye_height_weight(space: FreeSpace, positions: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, " n"]:
    """1 at heights of 0.3 to 0.6 between floor and ceiling, falling to 0.3 outside; 0.3 without a floor."""
    fraction = height_fraction(space, positions)
    outside = np.maximum(0.3 - fraction, 0.0) + np.maximum(fraction - 0.6, 0.0)
    return np.where(fraction > 0.0, np.maximum(1.0 - 2.0 * outside, 0.3), 0.3)


def _cameras_before_openings(space: FreeSpace) -> list[tuple[float, Camera]]:
    """Level views into a room through its open sides, as into a Cornell box; often there are none."""
    occupied = np.argwhere(space.occupied) + 0.5
    low, high = occupied.min(axis=0), occupied.max(axis=0)
    target, extent = 0.5 * (low + high), high - low
    cameras = []
    for axis, across in ((2, 0), (0, 2)):
        # Distance at which the open side fills the image's height or width, whichever it fills first.
        fitting = 0.5 * min(extent[1], extent[across] * 3.0 / 4.0) / math.tan(0.5 * OBJECT_YFOV)
        for side in (1.0, -1.0):
            back = np.zeros(3)
            back[axis] = side
            eye = target + (0.5 * extent[axis] + 0.97 * fitting) * back
            camera = Camera(look_at(space.to_world(eye), space.to_world(target)), OBJECT_YFOV)
            sight = seen_by(space, camera)
            hit = sight.hits.hit
            rays = (sight.points - eye) / np.maximum(sight.hits.distance, 1e-6)[:, None]
            front = hit & front_facing(space, sight.hits.voxel, np.where(hit[:, None], rays, 0.0))
            # Depth behind the open side, as a share of the room's depth.
            depth = (0.5 * extent[axis] - (sight.points - target) @ back) / extent[axis]
            inward = float(np.median(depth[front])) if front.any() else 0.0
            if hit.mean() > OPENING_HITS and front.mean() > FROM_FRONT and inward > OPENING_DEPTH:
                cameras.append((round(inward * float(front.mean()), 9), camera))
    return cameras


def _cameras_outside(space: FreeSpace) -> list[tuple[float, Camera]]:
    """Views from all around that frame the whole subject."""
    low, high = detail_bounds(space)
    target = 0.5 * (low + high)
    pieces = subject_pieces(space)
    near = NEAR_OUTSIDE * float(np.linalg.norm(space.shape))
    cameras = []
    for elevation in np.radians(ELEVATIONS):
        for azimuth in 2.0 * math.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS:
            back = np.array(
                [
                    math.cos(elevation) * math.sin(azimuth),
                    math.sin(elevation),
                    math.cos(elevation) * math.cos(azimuth),
                ]
            )
            local = (pieces - target) @ look_at(back, np.zeros(3))[:3, :3]
            tan_y = math.tan(0.5 * OBJECT_YFOV)
            # Far enough for every piece to be in the image: z + |y|/tan and z + |x|/(tan · 4/3), plus 2 %.
            reach = np.maximum(np.abs(local[:, 1]) / tan_y, np.abs(local[:, 0]) / (tan_y * 4.0 / 3.0))
            distance = 1.02 * float((reach + local[:, 2]).max())
            eye = space.to_world(target + distance * back)
            camera = Camera(look_at(eye, space.to_world(target)), OBJECT_YFOV)
            cameras.append((_rounded(_outdoor_score(composition(space, camera, near))), camera))
    return cameras


def _outdoor_score(seen: Composition) -> float:
    """Score of an image of an object: little background, many surfaces."""
    return seen.hit * (0.05 + seen.front**2) * _surface_score(seen) * (1.0 - seen.near) ** 3


def _rounded(score: float) -> float:
    """Four digits, so that rounding errors of a scaled or moved scene do not decide between equal views."""
    return float(f"{score:.3e}")
