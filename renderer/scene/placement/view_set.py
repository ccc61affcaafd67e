"""Fitted, validation and held-out views: the given camera and lights, and seeded random moves of both."""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.placement.free_space import FreeSpace, march_rays
from vpltune.renderer.scene.placement.sight import (
    Sight,
    frame_of,
    light_hits,
    lit_fraction,
    mean_square_distance_world,
    seen_by,
)
from vpltune.renderer.scene.placement.subject import space_of_view
from vpltune.renderer.scene.scene import Camera, Light, Scene
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import Split, View

# Choices: a camera moves by up to this share of the median depth it sees, a light by up to this share of the
# RMS distance of what it lights.
CAMERA_MOVE, LIGHT_MOVE = 0.25, 0.3
# A choice: the point that a camera or light aims at moves by up to this share of the same length.
TARGET_MOVE = 0.15
# A choice: a directional light turns by up to this angle, radians.
SUN_TURN = math.radians(25.0)
# A choice: the shortest move as a share of the longest, so that views differ.
SHORTEST_MOVE = 0.35
# A choice: smallest distance between a moved camera or light and the nearest occupied voxel, in voxels.
CLEARANCE = 1.8
# A choice: most moves tried for one view, each smaller than the one before.
ATTEMPTS = 60
# Choices: least share of rays that must hit a surface, and of visible surfaces that must be lit directly. If
# the start view has less, a fraction of its own share is enough.
LEAST_HITS, LEAST_LIT = 0.6, 0.08
# Random stream of each split. The numbers are part of the seed, so changing one changes the views.
_STREAMS: dict[Split, int] = {"fitted": 0, "held_out": 1, "validation": 2}


@dataclass(frozen=True, eq=False)
class _Start:
    """The unmoved view, from which all others are derived."""

    space: FreeSpace
    camera: Camera
    lights: tuple[Light, ...]
    sight: Sight
    lit: float


def views_for_scene(
    scene: Scene,
    camera: Camera,
    lights: tuple[Light, ...],
    *,
    fitted: int,
    validation: int = 0,
    held_out: int,
    size: tuple[int, int],
    seed: int,
) -> tuple[View, ...]:
    """Views of all three splits. The first fitted view has the given camera and lights; all others move them.

    Each moved view has its own random stream, so asking for more views does not change the others. Moved
    cameras and lights stay in free space, visible from where they started. A moved light keeps its kind, its
    cones and the irradiance on the surfaces that it lights.

    Args:
        scene: the scene.
        camera: the camera to start from.
        lights: the lights to start from.
        fitted: number of fitted views, at least 1.
        validation: number of validation views.
        held_out: number of held-out views.
        size: width and height in pixels.
        seed: of the random moves.

    Returns:
        The fitted, then the validation, then the held-out views, named "fitted_0" and so on.

    Raises:
        ValueError: `fitted` is less than 1, or `validation` or `held_out` is negative.
    """
    if fitted < 1 or min(validation, held_out) < 0:
        raise ValueError(
            "views_for_scene: fitted must be ≥ 1, validation and held_out ≥ 0, "
            f"got {fitted}, {validation} and {held_out}"
        )
    space = space_of_view(scene, camera)
    sight = seen_by(space, camera)
    start = _Start(space, camera, lights, sight, lit_fraction(space, sight, lights))
    views = [View("fitted_0", "fitted", size, camera, lights)]
    splits: dict[Split, range] = {
        "fitted": range(1, fitted),
        "validation": range(validation),
        "held_out": range(held_out),
    }
    for split, indices in splits.items():
        for index in indices:
            random = np.random.default_rng([seed, _STREAMS[split], index])
            moved_camera, moved_lights = _moved(start, random)
            views.append(View(f"{split}_{index}", split, size, moved_camera, moved_lights))
    return tuple(views)


def _moved(start: _Start, random: np.random.Generator) -> tuple[Camera, tuple[Light, ...]]:
    """Try smaller and smaller moves, down to 1/100 of the largest, and return the first acceptable one."""
    for attempt in range(ATTEMPTS):
        amount = 0.01 ** (attempt / (ATTEMPTS - 1))
        camera = _moved_camera(start, amount, random)
        lights = tuple(_moved_light(start.space, light, amount, random) for light in start.lights)
        if _acceptable(start, camera, lights):
            break
    return camera, lights


def _acceptable(start: _Start, camera: Camera, lights: tuple[Light, ...]) -> bool:
    sight = seen_by(start.space, camera)
    if sight.hit_fraction < min(LEAST_HITS, 0.9 * start.sight.hit_fraction):
        return False
    if sight.depth() < 0.5 * start.sight.depth():
        return False
    return lit_fraction(start.space, sight, lights) >= min(LEAST_LIT, 0.5 * start.lit)


def _moved_camera(start: _Start, amount: float, random: np.random.Generator) -> Camera:
    """The camera moved by up to `CAMERA_MOVE`. It still looks at roughly the middle of the start view."""
    space, to_world = start.space, start.camera.to_world
    depth = start.sight.depth() or 0.5 * float(np.linalg.norm(space.shape))
    eye = space.to_voxels(start.camera.position_world)
    target = eye - depth * to_world[:3, 2] + TARGET_MOVE * amount * depth * _in_ball(random)
    # Half as far up and down, to stay near eye height.
    offset = CAMERA_MOVE * amount * depth * _in_shell(random) * np.array([1.0, 0.5, 1.0])
    moved = _as_far_as_free(space, eye, offset)
    up = to_world[:3, 1] if abs(to_world[1, 2]) > 0.98 else None
    return Camera(look_at(space.to_world(moved), space.to_world(target), up), start.camera.yfov)


def _moved_light(space: FreeSpace, light: Light, amount: float, random: np.random.Generator) -> Light:
    if light.kind == "directional":
        direction = _turned(
            light.direction_world, SUN_TURN * amount * random.uniform(SHORTEST_MOVE, 1.0), random
        )
        return dataclasses.replace(light, direction_world=direction)
    before = mean_square_distance_world(space, light_hits(space, light))
    reach = math.sqrt(before) / space.voxel_world or 0.25 * float(np.linalg.norm(space.shape))
    position = space.to_voxels(light.position_world)
    moved = _as_far_as_free(space, position, LIGHT_MOVE * amount * reach * _in_shell(random))
    # The spot still aims at roughly the same place.
    target = position + reach * light.direction_world + TARGET_MOVE * amount * reach * _in_ball(random)
    towards = target - moved
    direction = towards / np.linalg.norm(towards) if light.kind == "spot" else light.direction_world
    there = dataclasses.replace(light, position_world=space.to_world(moved), direction_world=direction)
    after = mean_square_distance_world(space, light_hits(space, there))
    if before > 0.0 and after > 0.0:
        # Irradiance is proportional to intensity / mean square distance; keep it, and where it ends.
        there = dataclasses.replace(
            there,
            intensity=light.intensity * (after / before),
            range=light.range * math.sqrt(after / before),
        )
    return there


def _as_far_as_free(
    space: FreeSpace, start: Float64[np.ndarray, "3"], offset: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, "3"]:
    """The farthest free and visible point along `offset`, or along −`offset` if that leads farther."""
    there, back = _free_along(space, start, offset), _free_along(space, start, -offset)
    # Farther by more than a voxel, so that rounding does not decide a tie in open space.
    return back if np.linalg.norm(back - start) > np.linalg.norm(there - start) + 1.0 else there


def _free_along(
    space: FreeSpace, start: Float64[np.ndarray, "3"], offset: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, "3"]:
    length = float(np.linalg.norm(offset))
    if not length > 0.0:
        return start
    free = float(march_rays(space, start[None, :], offset[None, :] / length).distance[0])
    steps = np.linspace(1.0, 0.0, 17)[:-1]
    points = start + steps[:, None] * offset
    # If the start itself is close to a surface, its own clearance is enough.
    needed = min(CLEARANCE, float(space.clearance_at(start[None, :])[0]))
    good = (steps * length < free) & (space.clearance_at(points) >= needed)
    return points[int(good.argmax())] if good.any() else start


def _in_ball(random: np.random.Generator) -> Float64[np.ndarray, "3"]:
    """A uniform random point in the unit ball."""
    direction = random.standard_normal(3)
    return direction / np.linalg.norm(direction) * random.uniform() ** (1.0 / 3.0)


def _in_shell(random: np.random.Generator) -> Float64[np.ndarray, "3"]:
    """A random point whose distance from the origin is uniform between `SHORTEST_MOVE` and 1."""
    direction = random.standard_normal(3)
    return direction / np.linalg.norm(direction) * random.uniform(SHORTEST_MOVE, 1.0)


def _turned(
    direction: Float64[np.ndarray, "3"], angle: float, random: np.random.Generator
) -> Float64[np.ndarray, "3"]:
    """A unit direction turned by `angle` (radians) about a random axis perpendicular to it."""
    u, v = frame_of(direction)
    azimuth = random.uniform(0.0, 2.0 * math.pi)
    return math.cos(angle) * direction + math.sin(angle) * (math.cos(azimuth) * u + math.sin(azimuth) * v)
