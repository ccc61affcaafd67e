"""Views to fit to and others to hold out: the given camera and lights, and seeded moves of both."""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.placement.free_space import FreeSpace, free_space, march_rays
from vpltune.renderer.scene.placement.sight import (
    Sight,
    frame_of,
    light_hits,
    lit_fraction,
    mean_square_distance_world,
    seen_by,
)
from vpltune.renderer.scene.scene import Camera, Light, Scene, look_at
from vpltune.renderer.scene.views import Split, View

# A camera moves by up to this share of the median depth that it sees, a light of its root mean square reach.
CAMERA_MOVE, LIGHT_MOVE = 0.25, 0.3
# What it looks at moves by up to this share of the same length.
TARGET_MOVE = 0.15
# A directional light turns by up to this.
SUN_TURN = math.radians(25.0)
# No move is shorter than this share of the longest, so that no two views are the same.
SHORTEST_MOVE = 0.35
# Voxels kept between a moved camera or light and the nearest surface.
CLEARANCE = 1.8
ATTEMPTS = 60
# Least share of rays that must meet something, and of the surfaces seen that must be lit; where the start has
# less, relative to the start.
LEAST_HITS, LEAST_LIT = 0.6, 0.08
# Which random stream moves the views of a split.
_STREAMS: dict[Split, int] = {"fitted": 0, "held_out": 1, "validation": 2}


@dataclass(frozen=True, eq=False)
class _Start:
    """The view that all others are moved from."""

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
    """`fitted` views, the first of them the given camera and lights unmoved, then `validation` and
    `held_out` ones.

    Each moved view has a random stream of its own, so that asking for more leaves the others as they were.
    Moved cameras and lights stay in free space in sight of where they started; a moved light keeps its kind
    and cones, and the irradiance at what it lights.

    Raises:
        ValueError: `fitted` is less than 1, or `validation` or `held_out` is negative.
    """
    if fitted < 1 or min(validation, held_out) < 0:
        raise ValueError(
            "views_for_scene: fitted must be ≥ 1, validation and held_out ≥ 0, "
            f"got {fitted}, {validation} and {held_out}"
        )
    space = free_space(scene)
    sight = seen_by(space, camera)
    start = _Start(space, camera, lights, sight, lit_fraction(space, sight, lights))
    views = [View("fitted_0", "fitted", size, camera, lights)]
    splits: list[tuple[Split, int]] = [("fitted", i) for i in range(1, fitted)]
    splits += [("validation", i) for i in range(validation)]
    splits += [("held_out", i) for i in range(held_out)]
    for split, index in splits:
        random = np.random.default_rng([seed, _STREAMS[split], index])
        moved_camera, moved_lights = _moved(start, random)
        views.append(View(f"{split}_{index}", split, size, moved_camera, moved_lights))
    return tuple(views)


def _moved(start: _Start, random: np.random.Generator) -> tuple[Camera, tuple[Light, ...]]:
    """The first acceptable one of ever smaller moves; the smallest is a hundredth of the largest."""
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
    """Moved across and along the view; it still looks at about what lay in the middle of the start view."""
    space, to_world = start.space, start.camera.to_world
    depth = start.sight.depth() or 0.5 * float(np.linalg.norm(space.shape))
    eye = space.to_voxels(start.camera.position_world)
    target = eye - depth * to_world[:3, 2] + TARGET_MOVE * amount * depth * _in_ball(random)
    # Half as far up and down, so that eye height is about kept.
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
    # What lay ahead of the spot stays about ahead of it.
    target = position + reach * light.direction_world + TARGET_MOVE * amount * reach * _in_ball(random)
    towards = target - moved
    direction = towards / np.linalg.norm(towards) if light.kind == "spot" else light.direction_world
    there = dataclasses.replace(light, position_world=space.to_world(moved), direction_world=direction)
    after = mean_square_distance_world(space, light_hits(space, there))
    if before > 0.0 and after > 0.0:
        # Irradiance goes with intensity over the mean square distance.
        there = dataclasses.replace(there, intensity=light.intensity * (after / before))
    return there


def _as_far_as_free(
    space: FreeSpace, start: Float64[np.ndarray, "3"], offset: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, "3"]:
    """The farthest free point in sight along an offset, or against it where that goes farther."""
    there, back = _free_along(space, start, offset), _free_along(space, start, -offset)
    # By at least a voxel, so that a tie in open space is not decided by rounding.
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
    # A start that is itself close to a surface need not be left for a place farther from it.
    needed = min(CLEARANCE, float(space.clearance_at(start[None, :])[0]))
    good = (steps * length < free) & (space.clearance_at(points) >= needed)
    return points[int(good.argmax())] if good.any() else start


def _in_ball(random: np.random.Generator) -> Float64[np.ndarray, "3"]:
    """A point of the unit ball, evenly spread."""
    direction = random.standard_normal(3)
    return direction / np.linalg.norm(direction) * random.uniform() ** (1.0 / 3.0)


def _in_shell(random: np.random.Generator) -> Float64[np.ndarray, "3"]:
    """A point between the radii `SHORTEST_MOVE` and 1."""
    direction = random.standard_normal(3)
    return direction / np.linalg.norm(direction) * random.uniform(SHORTEST_MOVE, 1.0)


def _turned(
    direction: Float64[np.ndarray, "3"], angle: float, random: np.random.Generator
) -> Float64[np.ndarray, "3"]:
    """A unit direction turned by `angle` about a random axis square to it."""
    u, v = frame_of(direction)
    azimuth = random.uniform(0.0, 2.0 * math.pi)
    return math.cos(angle) * direction + math.sin(angle) * (math.cos(azimuth) * u + math.sin(azimuth) * v)
