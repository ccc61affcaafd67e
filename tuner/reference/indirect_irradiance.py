"""Indirect irradiance at every pixel centre: final gathering combined with paths from the lights.

    E_ind(x) = ∫ L(x, ω) cos θ dω,    L(x, ω) = ρ(y)/π · (E_direct(y) + E_ind(y))

y is the surface that x sees along ω. For one bounce, E_ind(y) is left out. Two strategies sample y: a
cosine-weighted direction from x, and a path from one of the lights, which finds the spots that narrow beams
light. The balance heuristic combines them (Veach and Guibas 1995, "Optimally Combining Sampling Techniques",
eq. 9). The sum is unbiased and has no spikes near corners. The albedo of x is never divided out, so black
receivers are as accurate as others. A path tracer's depth 3 minus depth 2 has the same expectation.

Surfaces are two-sided and diffuse about their shading normals, like Mitsuba's `twosided` `diffuse`: light
counts if it arrives on the visible side of the shading normal.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt32

from vpltune.renderer.scene.views import View, ray_directions_world
from vpltune.tuner.reference.directions import cosine_direction
from vpltune.tuner.reference.punctual_lights import PunctualLights
from vpltune.tuner.reference.sobol import hashed, owen_scrambled, reversed_sobol_points
from vpltune.tuner.reference.surfaces import Surface, Surfaces
from vpltune.tuner.reference.unit_triangles import UnitTriangles

LANE_SAMPLES_PER_LAUNCH = 2**21
"""Lanes times samples in one kernel. A choice: a kernel then takes about a second, and progress reports and
interrupts have to wait for the end of a kernel."""

ROULETTE_DEPTH = 3
"""Russian roulette starts after this many bounces. A choice: it does not change the expectation."""
ROULETTE_SURVIVAL = 0.95
"""Upper limit on the survival probability, else the throughput's largest component. A choice."""
BOUNCE_LIMIT = 64
"""Every path ends here. A choice: it bounds the time in scenes that absorb nothing."""

_SEEDS = 5  # per pixel: one scramble for each number of the first vertex, and one seed for the hash
_NUMBERS_PER_VERTEX = 6  # light, roulette, direction (2), light path (2)


@dataclass(frozen=True, eq=False)
class PrimaryHits:
    """The surfaces seen at the pixel centres. Every array is zero where a pixel sees none."""

    valid: Bool[np.ndarray, "height width"]
    position_world: Float64[np.ndarray, "height width 3"]
    normal_world: Float32[np.ndarray, "height width 3"]
    """Shading normals of unit length, flipped towards the camera."""
    albedo: Float32[np.ndarray, "height width 3"]
    direct_irradiance: Float32[np.ndarray, "height width 3"]
    """W/m², with shadows."""


class IndirectIrradiance:
    """Estimator for one view. The constructor traces the primary hits; `batches` samples indirect irradiance.

    There are two independent estimates, called halves. Each randomises the same low-discrepancy points in its
    own way and is unbiased for any sample count. The lanes are the pixels of the first half, then those of
    the second.
    """

    def __init__(self, wavefront, surfaces: Surfaces, triangles: UnitTriangles, view: View):
        self._wavefront, self._surfaces, self._size = wavefront, surfaces, view.size
        self._lights = PunctualLights(surfaces, triangles, view.lights)
        eye = wavefront.vectors(triangles.to_unit(view.camera.position_world)[None, :])
        directions = ray_directions_world(view).reshape(-1, 3)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        directions = wavefront.vectors(np.tile(directions, (2, 1)))

        def see():
            lanes = wavefront.all_true(2 * math.prod(view.size))
            seen = surfaces.first_along(eye, directions, lanes, seen=True)
            return seen, self._lights.irradiance(seen, seen.hit)

        self._seen, direct = wavefront.run(see)
        wavefront.evaluate(*self._seen, direct)
        self.primary_hits = self._to_world(triangles, direct)

    def _to_world(self, triangles: UnitTriangles, direct) -> PrimaryHits:
        width, height = self._size
        valid = self._wavefront.to_numpy(self._seen.hit)[: width * height].reshape(height, width)

        def image(vectors) -> Float32[np.ndarray, "height width 3"]:
            values = self._wavefront.to_numpy(vectors)[: width * height].reshape(height, width, 3)
            return np.where(valid[..., None], values, np.float32(0.0))

        position = image(self._seen.position).astype(np.float64) * triangles.diagonal
        return PrimaryHits(
            valid=valid,
            position_world=np.where(valid[..., None], position + triangles.center_world, 0.0),
            normal_world=image(self._seen.shading_normal),
            albedo=image(self._seen.albedo),
            direct_irradiance=image(direct),
        )

    def batches(
        self, first: int, count: int, seed: int, bounces: int | None
    ) -> Iterator[tuple[int, Float32[np.ndarray, "2 height width 3"]]]:
        """Take samples `first` … `first` + `count` − 1 of both halves, one kernel at a time.

        Args:
            first: Index of the first sample.
            count: Samples per pixel and half.
            seed: Seed of both halves' randomisation.
            bounces: Reflections before light arrives at the receiver; None for up to `BOUNCE_LIMIT`.

        Yields:
            Samples taken by one kernel, and their sum for each half in W/m².
        """
        w = self._wavefront
        width, height = self._size
        lanes = 2 * width * height
        seeds = w.table(np.concatenate([_pixel_seeds(seed, half, width * height) for half in range(2)]))
        limit = w.table(np.array([BOUNCE_LIMIT if bounces is None else bounces], np.uint32))
        most = max(1, LANE_SAMPLES_PER_LAUNCH // lanes)
        while count > 0:
            taken = min(count, most)
            total = w.run(partial(self._sum_of_samples, seeds, first, taken, limit))
            yield taken, w.to_numpy(total).reshape(2, height, width, 3)
            first, count = first + taken, count - taken

    def _sum_of_samples(self, seeds, first: int, count: int, limit):
        w = self._wavefront
        lanes = 2 * math.prod(self._size)
        points = w.table(reversed_sobol_points(first, count))
        start, end = (w.table(np.array([number], np.uint32)) for number in (first, count))
        lane = w.lanes(lanes)
        scrambles = [w.take(seeds, lane * _SEEDS + k) for k in range(_SEEDS)]

        def add_sample(index, total):
            pair = [w.take(points, index * 2 + k % 2) for k in range(4)]
            first_numbers = tuple(owen_scrambled(w, pair[k], scrambles[k]) for k in range(4))
            stream = (start + index) * (_NUMBERS_PER_VERTEX * (BOUNCE_LIMIT + 1))
            return index + 1, total + self._arriving(first_numbers, stream, scrambles[4], limit)

        _, total = w.loop(lambda index, _: index < end, add_sample, (start * 0, w.zero_vectors(lanes)))
        return total

    def _arriving(self, first_numbers, stream, seed, limit):
        """One sample of the indirect irradiance (W/m²) at the pixel centres.

        The first vertex takes its cosine-weighted direction and its light path from `first_numbers`. All
        other random numbers are hashed from `stream`.
        """
        w = self._wavefront

        def bounce(depth, alive, vertex, numbers, throughput, arriving):
            x = Surface(*vertex)
            chosen, survives, *following = (
                hashed(w, stream + depth * _NUMBERS_PER_VERTEX + k, seed) for k in range(6)
            )
            arriving = arriving + throughput * self._from_light_path(x, alive, chosen, *numbers[2:])
            y, gathered = self._from_cosine_direction(x, alive, *numbers[:2])
            alive = alive & y.hit
            throughput = throughput * y.albedo
            arriving = arriving + w.where(alive, throughput * gathered, 0.0)
            depth = depth + 1
            largest = w.maximum(w.maximum(throughput[0], throughput[1]), throughput[2])
            survival = w.where(depth < ROULETTE_DEPTH, 1.0, w.minimum(largest, ROULETTE_SURVIVAL))
            alive = alive & (depth < limit) & (survives < survival)
            throughput = throughput / w.maximum(survival, 1e-12)
            return depth, alive, tuple(y), tuple(following), throughput, arriving

        black = self._seen.position * 0.0
        state = (
            limit * 0,
            self._seen.hit & (limit > 0),
            tuple(self._seen),
            first_numbers,
            black + 1.0,
            black,
        )
        return w.loop(lambda depth, alive, *_: alive, bounce, state)[-1]

    def _from_cosine_direction(self, x: Surface, alive, u, v):
        """The surface y along a cosine-weighted direction from x, and the direct irradiance at y times the
        weight of the balance heuristic."""
        w = self._wavefront
        direction = cosine_direction(w, x.shading_normal, u, v)
        y = self._surfaces.first_along(x.ray_origin(w, direction), direction, alive)
        density = _cosine_density(w, x, y)
        count = w.to_number(self._lights.count)

        def balance(paths):
            # 1e-30 only avoids 0/0: where both densities are zero, no light arrives.
            return density / w.maximum(density + paths / count, 1e-30)

        return y, self._lights.irradiance(y, alive & y.hit, balance)

    def _from_light_path(self, x: Surface, alive, chosen, u, v):
        """Contribution to x (W/m²) of a path from a random light, times the balance heuristic's weight."""
        w = self._wavefront
        count = w.to_number(self._lights.count)
        light = w.to_index(w.minimum(w.floor(chosen * count), w.maximum(count - 1.0, 0.0)))
        alive = alive & (count > 0.0)
        origin, direction = self._lights.emitted(light, u, v)
        y = self._surfaces.first_along(origin, direction, alive)
        _, _, irradiance, paths = self._lights.arriving(light, y)
        density = _cosine_density(w, x, y)
        to_x = x.position - y.position
        facing = (w.dot(y.shading_normal, to_x) > 0.0) & (w.dot(irradiance, irradiance) > 0.0)
        facing = alive & y.hit & facing & (density > 0.0)
        start = y.ray_origin(w, to_x)
        passing = self._surfaces.passing(start, x.ray_origin(w, -to_x) - start, 1.0, facing)
        # ρ/π · E · geometry ÷ (light-path density) × weight. The density of light paths cancels.
        scale = passing * density / w.maximum(density + paths / count, 1e-30)
        return w.where(facing & (passing > 0.0), y.albedo * irradiance * scale, 0.0)


def _cosine_density(wavefront, x: Surface, y: Surface):
    """Density per unit area at y of cosine-weighted directions from x: max(0, cos θ_x)·|cos θ_y|/(π·d²)."""
    w = wavefront
    to_y = y.position - x.position
    squared = w.maximum(w.dot(to_y, to_y), 1e-20)
    slant = w.dot(y.geometric_normal, to_y)
    cosines = w.maximum(w.dot(x.shading_normal, to_y), 0.0) * w.maximum(slant, -slant)
    return cosines / (squared * squared * math.pi)


def _pixel_seeds(seed: int, half: int, pixels: int) -> UInt32[np.ndarray, "pixels 5"]:
    """For each pixel, four scrambles for the numbers of the first vertex and one seed for all others."""
    rng = np.random.default_rng([seed, half])
    return rng.integers(0, 2**32, (pixels, _SEEDS), dtype=np.uint32)
