"""Lights that bounce through a scene: gravity, and elastic reflection off its surfaces and bounds.

Everything happens in voxels of the scene's free-space grid, so a scene and the same scene at another scale
have the same motion. Time goes by in ticks of fixed length and positions between ticks are interpolated:
where a light is hangs on the time alone, not on how it was cut into frames.
"""

import math

import numpy as np
from jaxtyping import Float64, Int64

from vpltune.renderer.scene.dynamic_lights import point_lights, spot_lights
from vpltune.renderer.scene.placement.free_space import FreeSpace, free_space
from vpltune.renderer.scene.placement.sight import light_hits, mean_square_distance_world
from vpltune.renderer.scene.scene import Light, Scene

SPEED = 0.15
"""Of a light when it sets out, in longest sides of the grid per second."""
GRAVITY = 0.15
"""In longest sides of the grid per second², downwards (−Y)."""
LONGEST_STEP = 0.5
"""In voxels per tick: a surface one voxel thick is not jumped over."""
OVERLAP = 6.0
"""Lights whose reach a free place lies in, on average."""
LARGEST_RANGE = 0.25
"""In longest sides of the scene."""
SPOT_CONE = (math.radians(20.0), math.radians(35.0))
SPOT_SHARE = 0.25
SPOT_RANGE = 2.0
"""Of a spot's range to a point light's: its flux goes one way."""

BRIGHTNESS = 0.125


class BouncingLights:
    """`count` lights on their way through a scene.

    Colours, places and directions come from `seed`. A quarter are spots, which shine the way they fly.

    Args:
        flux: of all lights together, in each channel on average [W].
        range_world: of the point lights, in world units; None has `OVERLAP` of them reach any free place.
    """

    def __init__(self, scene: Scene, count: int, seed: int, flux: float, range_world: float | None = None):
        rng = np.random.default_rng(seed)
        self._space = free_space(scene)
        self._low, self._high = self._space.to_voxels(scene.bounds())
        self._position = _free_places(self._space, self._low, self._high, count, rng)
        direction = rng.normal(size=(count, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        longest = float(max(self._space.shape))
        self._velocity = SPEED * longest * direction
        height = float(self._high[1] - self._low[1])
        fastest = longest * math.sqrt(SPEED**2 + 2.0 * GRAVITY * height / longest)
        self._tick_seconds = LONGEST_STEP / fastest
        self._fall = GRAVITY * longest * self._tick_seconds
        self._ticks, self._seconds = 0, 0.0
        self._before = self._position.copy()
        self._spot_count = int(SPOT_SHARE * count)
        if range_world is None:
            range_world = _range_for_overlap(self._space, count)
        self.records = self._make_records(rng, flux, range_world)
        self._place_records()

    def advance(self, seconds: float) -> None:
        """Move on; `records` are then those of the new time."""
        self._seconds += seconds
        while self._ticks < self._seconds / self._tick_seconds:
            self._tick()
        self._place_records()

    def _tick(self) -> None:
        """One leapfrog step, or a reflection in place of it: reversible either way, so that energy stays."""
        self._ticks += 1
        self._before = self._position.copy()
        mean_velocity = self._velocity - (0.0, 0.5 * self._fall, 0.0)
        ahead = self._position + self._tick_seconds * mean_velocity
        outside = (ahead < self._low) | (ahead > self._high)
        leaving = outside.any(axis=1)
        voxel = self._voxels(np.clip(ahead, self._low, self._high))
        entering = self._space.occupied.ravel()[voxel] & ~leaving
        moving = ~leaving & ~entering
        np.copyto(self._position, ahead, where=moving[:, None])
        self._velocity[moving, 1] -= self._fall
        inwards = 0.5 * (self._low + self._high) - ahead
        np.copyto(
            self._velocity, np.copysign(np.maximum(abs(self._velocity), self._fall), inwards), where=outside
        )
        lights = np.flatnonzero(entering)
        self._velocity[lights] = self._reflected(self._velocity[lights], mean_velocity[lights], voxel[lights])

    def _reflected(
        self,
        velocity: Float64[np.ndarray, "m 3"],
        mean_velocity: Float64[np.ndarray, "m 3"],
        voxel: Int64[np.ndarray, " m"],
    ) -> Float64[np.ndarray, "m 3"]:
        """Velocities mirrored about the surface in the voxels that lights are about to enter."""
        backwards = -mean_velocity / np.linalg.norm(mean_velocity, axis=1, keepdims=True)
        normal = self._space.normals.reshape(-1, 3)[voxel].astype(np.float64)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        # Where faces oppose each other in a voxel there is no one normal: back the way it came.
        normal = np.where(length > 0.5, normal / np.maximum(length, 0.5), backwards)
        # Surfaces are solid from both sides: the side counts that the light is on.
        normal *= np.copysign(1.0, (normal * backwards).sum(axis=1, keepdims=True))
        along = (velocity * normal).sum(axis=1, keepdims=True)
        # Slower than one tick's fall, a light would be drawn back before it has left.
        return velocity + (np.maximum(abs(along), self._fall) - along) * normal

    def _voxels(self, positions: Float64[np.ndarray, "n 3"]) -> Int64[np.ndarray, " n"]:
        _, rows, columns = self._space.shape
        cell = positions.astype(np.int64)
        return (cell[:, 0] * rows + cell[:, 1]) * columns + cell[:, 2]

    def _make_records(self, rng: np.random.Generator, flux: float, range_world: float) -> np.ndarray:
        count, spots = len(self._position), self._spot_count
        # One channel low, one high, one between, in any order: saturated, and each the same in sum.
        color = rng.permuted(np.column_stack([np.full(count, 0.1), rng.uniform(0.2, 1.6, count)]), axis=1)
        color = np.column_stack([color, 3.0 - color.sum(axis=1)])
        color = rng.permuted(color, axis=1) * (flux / max(count, 1))
        where = np.zeros((count, 3))
        points = point_lights(where[spots:], color[spots:] / (4.0 * math.pi), range_world)
        # A spot's flux as if it were evenly bright to its outer cone.
        solid_angle = 2.0 * math.pi * (1.0 - math.cos(SPOT_CONE[1]))
        return np.concatenate(
            [
                points,
                spot_lights(
                    where[:spots],
                    color[:spots] / solid_angle,
                    SPOT_RANGE * range_world,
                    where[:spots],
                    *SPOT_CONE,
                ),
            ]
        )

    def _place_records(self) -> None:
        share = self._seconds / self._tick_seconds - (self._ticks - 1) if self._ticks else 1.0
        between = self._before + share * (self._position - self._before)
        self.records["position_world"] = self._space.to_world(between)
        spots = self.records[len(self.records) - self._spot_count :]
        velocity = self._velocity[len(self.records) - self._spot_count :]
        spots["direction_world"] = velocity / np.linalg.norm(velocity, axis=1, keepdims=True)


def _free_places(
    space: FreeSpace,
    low: Float64[np.ndarray, "3"],
    high: Float64[np.ndarray, "3"],
    count: int,
    rng: np.random.Generator,
) -> Float64[np.ndarray, "count 3"]:
    """Random points of random empty voxels within the scene's bounds; anywhere within where none is empty."""
    cell = np.argwhere(~space.occupied)
    cell = cell[((cell >= low) & (cell + 1.0 <= high)).all(axis=1)]
    if not len(cell):
        return rng.uniform(low, high, (count, 3))
    return cell[rng.integers(len(cell), size=count)] + rng.random((count, 3))


def _range_for_overlap(space: FreeSpace, count: int) -> float:
    """Range at which spheres around `count` lights cover the free space `OVERLAP` times, in world units."""
    free = max(1, int(np.count_nonzero(~space.occupied)))
    radius = (OVERLAP * free / (4.0 / 3.0 * math.pi * max(1, count))) ** (1.0 / 3.0)
    return min(radius, LARGEST_RANGE * max(space.shape)) * space.voxel_world


def flux_beside(scene: Scene, lights: tuple[Light, ...]) -> float:
    """Flux [W] with which moving lights stand out beside a view's own lights, and do not outshine them.

    It brings the scene's surfaces, on average, to `BRIGHTNESS` of what the view's lights bring to those that
    they meet (π W/m² where they meet none), mean of the channels.
    """
    space = free_space(scene)
    irradiance = sum(_irradiance_met(space, light) for light in lights) or math.pi
    area = float(space.area.sum(dtype=np.float64)) * space.voxel_world**2
    return BRIGHTNESS * irradiance * area


def _irradiance_met(space: FreeSpace, light: Light) -> float:
    """At the root mean square distance of what a light meets [W/m²]; 0 where it meets nothing."""
    level = float(light.intensity.mean())
    if light.kind == "directional":
        return level
    square = mean_square_distance_world(space, light_hits(space, light))
    return level / square if square > 0.0 else 0.0
