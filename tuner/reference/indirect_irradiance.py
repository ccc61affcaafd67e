"""Indirect irradiance at every pixel centre: final gathering combined with paths from the lights.

    E_ind(x) = ∫ L(x, ω) cos θ dω,    L(x, ω) = ρ(y)/π · (E_direct(y) + E_ind(y))

y is the surface that x sees along ω. For one bounce, E_ind(y) is left out. Two strategies sample y: a
cosine-weighted direction from x, and a path from one of the punctual lights, which finds the spots that
narrow beams light. The balance heuristic combines them (Veach and Guibas 1995, "Optimally Combining Sampling
Techniques", eq. 9). The sum is unbiased and has no spikes near corners. The albedo of x is never divided out,
so black receivers are as accurate as others. A path tracer's depth 3 minus depth 2 has the same expectation.

E_direct is the punctual lights' irradiance, which has no noise, plus that of glowing surfaces and the
environment. The latter is sampled at x and at every y, by the direction that finds the next vertex and by a
sample of the light (`emitted_light`). Where nothing glows, none of this is computed.

Surfaces are two-sided and diffuse about their shading normals, like Mitsuba's `twosided` `diffuse`: light
counts if it arrives on the visible side of the shading normal.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt32

from vpltune.renderer.scene.views import View, ray_directions_world
from vpltune.tuner.reference.directions import cosine_direction
from vpltune.tuner.reference.punctual_lights import PunctualLights
from vpltune.tuner.reference.sobol import hashed, hashed_twice, owen_scrambled, reversed_sobol_points
from vpltune.tuner.reference.surfaces import Surface, cosine_density
from vpltune.tuner.reference.traced_scene import TracedScene
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

_FIRST_NUMBERS = 4  # of the first vertex, from low-discrepancy points: direction (2), light path (2)
_OTHER_NUMBERS = 2  # of every vertex: light, roulette
_EMITTED_NUMBERS = 2  # more of both kinds of vertex where something glows: the light sample


@dataclass(frozen=True, eq=False)
class PrimaryHits:
    """The surfaces seen at the pixel centres. Every array is zero where a pixel sees none."""

    valid: Bool[np.ndarray, "height width"]
    position_world: Float64[np.ndarray, "height width 3"]
    normal_world: Float32[np.ndarray, "height width 3"]
    """Shading normals of unit length, flipped towards the camera."""
    albedo: Float32[np.ndarray, "height width 3"]
    direct_irradiance: Float32[np.ndarray, "height width 3"]
    """From punctual lights, W/m², with shadows."""
    emission: Float32[np.ndarray, "height width 3"] | None
    """Radiance that a pixel sees of what glows, also where it sees no surface: W/(m² sr). None if nothing
    glows."""


class Batch(NamedTuple):
    """The sums over the samples of one kernel, for each half, in W/m²."""

    samples: int
    irradiance: Float32[np.ndarray, "2 height width 3"]
    """Indirect."""
    emitted: Float32[np.ndarray, "2 height width 3"] | None
    """Direct, from what glows; None if nothing does."""


class IndirectIrradiance:
    """Estimator for one view. The constructor traces the primary hits; `batches` samples indirect irradiance.

    There are two independent estimates, called halves. Each randomises the same low-discrepancy points in its
    own way and is unbiased for any sample count. The lanes are the pixels of the first half, then those of
    the second.
    """

    def __init__(self, traced: TracedScene, view: View):
        wavefront, surfaces, triangles = traced.wavefront, traced.surfaces, traced.triangles
        self._wavefront, self._surfaces, self._size = wavefront, surfaces, view.size
        self._emitted = traced.emitted
        self._first_numbers = _FIRST_NUMBERS + (0 if traced.emitted is None else _EMITTED_NUMBERS)
        self._lights = PunctualLights(surfaces, triangles, view.lights)
        eye = wavefront.vectors(triangles.to_unit(view.camera.position_world)[None, :])
        directions = ray_directions_world(view).reshape(-1, 3)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        directions = wavefront.vectors(np.tile(directions, (2, 1)))

        def see():
            lanes = wavefront.all_true(2 * math.prod(view.size))
            seen = surfaces.first_along(eye, directions, lanes, seen=True)
            glow = None if self._emitted is None else self._emitted.radiance(directions, seen)
            return seen._replace(glow=()), self._lights.irradiance(seen, seen.hit), glow

        self._seen, direct, glow = wavefront.run(see)
        wavefront.evaluate(*self._seen, direct, glow)
        self.primary_hits = self._to_world(triangles, direct, glow)

    def _to_world(self, triangles: UnitTriangles, direct, glow) -> PrimaryHits:
        width, height = self._size
        valid = self._wavefront.to_numpy(self._seen.hit)[: width * height].reshape(height, width)

        def whole(vectors) -> Float32[np.ndarray, "height width 3"]:
            return self._wavefront.to_numpy(vectors)[: width * height].reshape(height, width, 3)

        def image(vectors) -> Float32[np.ndarray, "height width 3"]:
            return np.where(valid[..., None], whole(vectors), np.float32(0.0))

        position = image(self._seen.position).astype(np.float64) * triangles.diagonal
        return PrimaryHits(
            valid=valid,
            position_world=np.where(valid[..., None], position + triangles.center_world, 0.0),
            normal_world=image(self._seen.shading_normal),
            albedo=image(self._seen.albedo),
            direct_irradiance=image(direct),
            emission=None if glow is None else whole(glow),
        )

    def batches(self, first: int, count: int, seed: int, bounces: int | None) -> Iterator[Batch]:
        """Take samples `first` … `first` + `count` − 1 of both halves, one kernel at a time.

        Args:
            first: Index of the first sample.
            count: Samples per pixel and half.
            seed: Seed of both halves' randomisation.
            bounces: Reflections before light arrives at the receiver; None for up to `BOUNCE_LIMIT`.
        """
        w = self._wavefront
        width, height = self._size
        lanes = 2 * width * height
        rows = [_pixel_seeds(seed, half, width * height, self._first_numbers + 1) for half in range(2)]
        seeds = w.table(np.concatenate(rows))
        limit = w.table(np.array([BOUNCE_LIMIT if bounces is None else bounces], np.uint32))
        most = max(1, LANE_SAMPLES_PER_LAUNCH // lanes)
        while count > 0:
            taken = min(count, most)
            sums = w.run(partial(self._sum_of_samples, seeds, first, taken, limit))
            w.evaluate(*sums)
            images = [w.to_numpy(total).reshape(2, height, width, 3) for total in sums]
            yield Batch(taken, images[0], images[1] if self._emitted is not None else None)
            first, count = first + taken, count - taken

    def _sum_of_samples(self, seeds, first: int, count: int, limit):
        w = self._wavefront
        lanes = 2 * math.prod(self._size)
        points = w.table(reversed_sobol_points(first, count))
        start, end = (w.table(np.array([number], np.uint32)) for number in (first, count))
        lane = w.lanes(lanes)
        count_first = self._first_numbers
        scrambles = [w.take(seeds, lane * (count_first + 1) + k) for k in range(count_first + 1)]

        def add_sample(index, totals):
            pair = [w.take(points, index * 2 + k % 2) for k in range(count_first)]
            first_numbers = tuple(owen_scrambled(w, pair[k], scrambles[k]) for k in range(count_first))
            stream = (start + index) * ((count_first + _OTHER_NUMBERS) * (BOUNCE_LIMIT + 1))
            arriving = self._arriving(first_numbers, stream, scrambles[-1], limit)
            return index + 1, tuple(a + b for a, b in zip(totals, arriving, strict=True))

        nothing = tuple(w.zero_vectors(lanes) for _ in range(1 if self._emitted is None else 2))
        return w.loop(lambda index, _: index < end, add_sample, (start * 0, nothing))[1]

    def _arriving(self, first_numbers, stream, seed, limit) -> tuple:
        """One sample of the indirect irradiance (W/m²) at the pixel centres, and, if anything glows, of its
        direct irradiance.

        The first vertex takes its cosine-weighted direction, its light path and its light sample from
        `first_numbers`. All other random numbers are hashed from `stream`.
        """
        w = self._wavefront
        per_vertex = len(first_numbers) + _OTHER_NUMBERS
        # Scenes in which nothing glows keep the numbers that their cached references were made with.
        hashing = hashed if self._emitted is None else hashed_twice

        def bounce(depth, alive, vertex, numbers, throughput, arriving):
            x = Surface(*vertex)
            chosen, survives, *following = (
                hashing(w, stream + depth * per_vertex + k, seed) for k in range(per_vertex)
            )
            # Light that x reflects is counted up to the limit; what glows also shines on the last vertex.
            reflects = alive if self._emitted is None else alive & (depth < limit)
            indirect = arriving[0]
            indirect = indirect + throughput * self._from_light_path(x, reflects, chosen, *numbers[2:4])
            y, gathered, direction = self._from_cosine_direction(x, alive, reflects, *numbers[:2])
            if self._emitted is not None:
                emitted = self._emitted.from_cosine_direction(x, direction, y, alive)
                emitted = throughput * (emitted + self._emitted.from_light_sample(x, alive, *numbers[4:]))
                is_first = depth == 0
                indirect = indirect + w.where(is_first, 0.0, emitted)
                arriving = indirect, arriving[1] + w.where(is_first, emitted, 0.0)
            alive = reflects & y.hit
            throughput = throughput * y.albedo
            arriving = (indirect + w.where(alive, throughput * gathered, 0.0), *arriving[1:])
            depth = depth + 1
            largest = w.maximum(w.maximum(throughput[0], throughput[1]), throughput[2])
            survival = w.where(depth < ROULETTE_DEPTH, 1.0, w.minimum(largest, ROULETTE_SURVIVAL))
            goes_on = depth < limit if self._emitted is None else depth <= limit
            alive = alive & goes_on & (survives < survival)
            throughput = throughput / w.maximum(survival, 1e-12)
            return depth, alive, tuple(y._replace(glow=())), tuple(following), throughput, arriving

        black = self._seen.position * 0.0
        state = (
            limit * 0,
            self._seen.hit & (limit > 0),
            tuple(self._seen),
            first_numbers,
            black + 1.0,
            (black,) if self._emitted is None else (black, black),
        )
        return w.loop(lambda depth, alive, *_: alive, bounce, state)[-1]

    def _from_cosine_direction(self, x: Surface, alive, reflects, u, v):
        """The surface y along a cosine-weighted direction from x, the punctual lights' irradiance at y times
        the weight of the balance heuristic where x `reflects` it, and the direction."""
        w = self._wavefront
        direction = cosine_direction(w, x.shading_normal, u, v)
        y = self._surfaces.first_along(x.ray_origin(w, direction), direction, alive)
        density = cosine_density(w, x, y)
        count = w.to_number(self._lights.count)

        def balance(paths):
            # 1e-30 only avoids 0/0: where both densities are zero, no light arrives.
            return density / w.maximum(density + paths / count, 1e-30)

        return y, self._lights.irradiance(y, reflects & y.hit, balance), direction

    def _from_light_path(self, x: Surface, alive, chosen, u, v):
        """Contribution to x (W/m²) of a path from a random light, times the balance heuristic's weight."""
        w = self._wavefront
        count = w.to_number(self._lights.count)
        light = w.to_index(w.minimum(w.floor(chosen * count), w.maximum(count - 1.0, 0.0)))
        alive = alive & (count > 0.0)
        origin, direction = self._lights.emitted(light, u, v)
        y = self._surfaces.first_along(origin, direction, alive)
        _, _, irradiance, paths = self._lights.arriving(light, y)
        density = cosine_density(w, x, y)
        to_x = x.position - y.position
        facing = (w.dot(y.shading_normal, to_x) > 0.0) & (w.dot(irradiance, irradiance) > 0.0)
        facing = alive & y.hit & facing & (density > 0.0)
        start = y.ray_origin(w, to_x)
        passing = self._surfaces.passing(start, x.ray_origin(w, -to_x) - start, 1.0, facing)
        # ρ/π · E · geometry ÷ (light-path density) × weight. The density of light paths cancels.
        scale = passing * density / w.maximum(density + paths / count, 1e-30)
        return w.where(facing & (passing > 0.0), y.albedo * irradiance * scale, 0.0)


def _pixel_seeds(seed: int, half: int, pixels: int, count: int) -> UInt32[np.ndarray, "pixels count"]:
    """For each pixel, scrambles for the numbers of the first vertex and, last, one seed for all others."""
    rng = np.random.default_rng([seed, half])
    return rng.integers(0, 2**32, (pixels, count), dtype=np.uint32)
