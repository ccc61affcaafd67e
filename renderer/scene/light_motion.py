"""Lights that bounce through a scene under gravity, reflected elastically by its surfaces and bounds.

The simulation runs in voxel units of the scene's free-space grid, so the motion does not depend on the scale
of the scene. It advances in ticks of fixed length and interpolates positions between ticks, so the position
of a light depends on the time alone and not on the frame rate.
"""

import math

import numpy as np
from jaxtyping import Float64, Int64

from vpltune.renderer.scene.dynamic_lights import point_lights, spot_lights
from vpltune.renderer.scene.light_range import range_falloff
from vpltune.renderer.scene.placement.free_space import FreeSpace, free_space
from vpltune.renderer.scene.placement.sight import light_hits
from vpltune.renderer.scene.scene import Light, Scene

SPEED = 0.15
"""A choice: initial speed of a light, in longest grid sides per second."""
GRAVITY = 0.15
"""A choice: downward (−Y) acceleration, in longest grid sides per second²."""
LONGEST_STEP = 0.5
"""Longest move in one tick, in voxels. At half a voxel no light jumps over a surface one voxel thick."""
OVERLAP = 6.0
"""A choice: mean number of lights within whose range a point of free space lies."""
LARGEST_RANGE = 0.25
"""A choice: upper bound of that automatic range, in longest grid sides."""
SPOT_CONE = (math.radians(20.0), math.radians(35.0))
"""A choice: inner and outer half angle of the spots, radians."""
SPOT_SHARE = 0.25
"""A choice: share of the lights that are spots."""
SPOT_RANGE = 2.0
"""A choice: range of a spot in ranges of a point light. Its flux is concentrated, so it reaches farther."""

BRIGHTNESS = 0.125
"""A choice: irradiance from all moving lights, relative to that from the view's lights (`flux_beside`)."""


class BouncingLights:
    """`count` lights that move through a scene. `SPOT_SHARE` of them are spots, pointed along their velocity.

    `records` holds the lights at the current time, [count] of `DYNAMIC_LIGHT_DTYPE`, points before spots.

    Args:
        scene: gives the surfaces and bounds that reflect the lights.
        count: number of lights.
        seed: decides colours, starting positions and directions.
        flux: radiant flux of all lights together in W, mean of the three channels.
        range_world: range of the point lights in world units. None chooses it such that, on average,
            `OVERLAP` lights reach a point of free space.
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
        """Advance the time by `seconds` and update `records`."""
        self._seconds += seconds
        while self._ticks < self._seconds / self._tick_seconds:
            self._tick()
        self._place_records()

    def _tick(self) -> None:
        """A leapfrog step, or a reflection instead of it. Both are reversible, which conserves energy."""
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
        """Velocities reflected by the surfaces in the voxels that the lights are about to enter."""
        backwards = -mean_velocity / np.linalg.norm(mean_velocity, axis=1, keepdims=True)
        normal = self._space.normals.reshape(-1, 3)[voxel].astype(np.float64)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        # A voxel with opposing faces has no single normal, so the light goes back the way it came.
        normal = np.where(length > 0.5, normal / np.maximum(length, 0.5), backwards)
        # Surfaces reflect on both sides: flip the normal to the side that the light is on.
        normal *= np.copysign(1.0, (normal * backwards).sum(axis=1, keepdims=True))
        along = (velocity * normal).sum(axis=1, keepdims=True)
        # A light slower than one tick of gravity would fall back before it has left the surface.
        return velocity + (np.maximum(abs(along), self._fall) - along) * normal

    def _voxels(self, positions: Float64[np.ndarray, "n 3"]) -> Int64[np.ndarray, " n"]:
        _, rows, columns = self._space.shape
        cell = positions.astype(np.int64)
        return (cell[:, 0] * rows + cell[:, 1]) * columns + cell[:, 2]

    def _make_records(self, rng: np.random.Generator, flux: float, range_world: float) -> np.ndarray:
        count, spots = len(self._position), self._spot_count
        # Saturated colours: one low, one high and one middle channel in random order, with a mean of 1.
        color = rng.permuted(np.column_stack([np.full(count, 0.1), rng.uniform(0.2, 1.6, count)]), axis=1)
        color = np.column_stack([color, 3.0 - color.sum(axis=1)])
        color = rng.permuted(color, axis=1) * (flux / max(count, 1))
        where = np.zeros((count, 3))
        points = point_lights(where[spots:], color[spots:] / (4.0 * math.pi), range_world)
        # A spot's flux, approximated as uniform intensity out to the outer cone.
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
    """Random points in empty voxels within the bounds, or anywhere within them if no voxel is empty."""
    cell = np.argwhere(~space.occupied)
    cell = cell[((cell >= low) & (cell + 1.0 <= high)).all(axis=1)]
    if not len(cell):
        return rng.uniform(low, high, (count, 3))
    return cell[rng.integers(len(cell), size=count)] + rng.random((count, 3))


def _range_for_overlap(space: FreeSpace, count: int) -> float:
    """Range at which the spheres of `count` lights cover free space `OVERLAP` times, in world units."""
    free = max(1, int(np.count_nonzero(~space.occupied)))
    radius = (OVERLAP * free / (4.0 / 3.0 * math.pi * max(1, count))) ** (1.0 / 3.0)
    return min(radius, LARGEST_RANGE * max(space.shape)) * space.voxel_world


def flux_beside(scene: Scene, lights: tuple[Light, ...]) -> float:
    """Flux in W, mean of the channels, at which moving lights are visible beside a view's own lights.

    Spread over all surfaces, it gives `BRIGHTNESS` times the irradiance that the view's lights give the
    surfaces that they reach, or times π W/m² if they reach none.
    """
    space = free_space(scene)
    irradiance = sum(_irradiance_met(space, light) for light in lights) or math.pi
    area = float(space.area.sum(dtype=np.float64)) * space.voxel_world**2
    return BRIGHTNESS * irradiance * area


def _irradiance_met(space: FreeSpace, light: Light) -> float:
    """Irradiance in W/m² at the RMS distance of the surfaces a light reaches; 0 if it reaches none.

    The light does not reach what lies beyond its range, and falls off towards it.
    """
    level = float(light.intensity.mean())
    if light.kind == "directional":
        return level
    hits = light_hits(space, light)
    distance_world = hits.distance[hits.hit] * space.voxel_world
    reached = distance_world[distance_world < light.range]
    if not reached.size:
        return 0.0
    square = float((reached**2).mean())
    return level / square * float(range_falloff(light, np.array([math.sqrt(square)]))[0])
