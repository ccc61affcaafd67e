"""Indirect irradiance at the centre of every pixel, by cosine-weighted final gathering.

    E_ind(x) = ∫ L(x, ω) cos θ dω,    L(x, ω) = ρ(y)/π · (E_direct(y) + E_ind(y)),    y = x → ω

With ω drawn from cos θ/π the estimate is the mean of ρ(y)·(E_direct(y) + …): no π and no division by the
albedo of x, so receivers that reflect nothing are as good as others. One bounce stops at E_direct(y).
Light sources are points and directions, so E_direct is exact; the only noise is that of ω. A path
tracer's depth 3 minus depth 2 has the same expectation.

Surfaces are two-sided and reflect diffusely about their shading normals, as Mitsuba's `twosided`
`diffuse` does: light counts where it comes from the side of the shading normal that is seen.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Bool, Float32, Float64, UInt32

from renderer.views import View, ray_directions_world
from tuner.reference.punctual_lights import direct_irradiance, light_table
from tuner.reference.sobol import hashed, owen_scrambled, reversed_sobol_points
from tuner.reference.surfaces import Surface, Surfaces
from tuner.reference.unit_triangles import UnitTriangles

LANE_SAMPLES_PER_LAUNCH = 2**21
"""Bounds the time of one kernel to a second or so: progress and interrupts come between kernels."""

ROULETTE_DEPTH = 3
"""Paths of this many bounces or more live on with a probability of their albedo, at most …"""
ROULETTE_SURVIVAL = 0.95
BOUNCE_LIMIT = 64
"""… and end here for good, which bounds the time in a scene that absorbs nothing."""


@dataclass(frozen=True, eq=False)
class PrimaryHits:
    """What the pixel centres see, and the direct irradiance there."""

    valid: Bool[np.ndarray, "height width"]
    position_world: Float64[np.ndarray, "height width 3"]
    normal_world: Float32[np.ndarray, "height width 3"]
    """Shading normals, turned towards the eye."""
    albedo: Float32[np.ndarray, "height width 3"]
    direct_irradiance: Float32[np.ndarray, "height width 3"]


class IndirectIrradiance:
    """The estimator for one view: primary hits at once, indirect irradiance a batch of samples at a time.

    Two halves are sampled, each with its own randomisation of the same low-discrepancy points: they are
    independent, and each is unbiased at any number of samples. Lanes are the pixels of the first half,
    then those of the second.
    """

    def __init__(self, wavefront, surfaces: Surfaces, triangles: UnitTriangles, view: View):
        self._wavefront, self._surfaces, self._size = wavefront, surfaces, view.size
        self._lights = wavefront.table(light_table(triangles, view.lights))
        self._light_count = wavefront.table(np.array([len(view.lights)], np.uint32))
        eye = wavefront.vectors(triangles.to_unit(view.camera.position_world)[None, :])
        directions = ray_directions_world(view).reshape(-1, 3)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        directions = wavefront.vectors(np.tile(directions, (2, 1)))

        def see():
            seen = surfaces.first_along(eye, directions, wavefront.all_true(2 * math.prod(view.size)))
            return seen, self._direct(seen, seen.hit)

        self._seen, direct = wavefront.run(see)
        wavefront.evaluate(*self._seen, direct)
        self.primary_hits = self._to_world(triangles, direct)

    def _direct(self, at: Surface, active):
        return direct_irradiance(self._wavefront, at, self._lights, self._light_count, active)

    def _to_world(self, triangles: UnitTriangles, direct) -> PrimaryHits:
        width, height = self._size
        valid = self._wavefront.to_numpy(self._seen.hit)[: width * height].reshape(height, width)

        def picture(vectors) -> Float32[np.ndarray, "height width 3"]:
            values = self._wavefront.to_numpy(vectors)[: width * height].reshape(height, width, 3)
            return np.where(valid[..., None], values, np.float32(0.0))

        position = picture(self._seen.position).astype(np.float64) * triangles.diagonal
        return PrimaryHits(
            valid=valid,
            position_world=np.where(valid[..., None], position + triangles.center_world, 0.0),
            normal_world=picture(self._seen.shading_normal),
            albedo=picture(self._seen.albedo),
            direct_irradiance=picture(direct),
        )

    def batches(
        self, first: int, count: int, seed: int, bounces: int | None
    ) -> Iterator[tuple[int, Float32[np.ndarray, "2 height width 3"]]]:
        """Samples `first` … `first` + `count` − 1 of both halves, some at a time: (samples, their sum).

        `bounces` is the number of reflections that light makes before it arrives, None for any.
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
        lane_seeds = w.take_vector(seeds, w.lanes(lanes))

        def add_sample(index, total):
            first_direction = _cosine_direction(
                w,
                self._seen.shading_normal,
                owen_scrambled(w, w.take(points, index * 2), lane_seeds[0]),
                owen_scrambled(w, w.take(points, index * 2 + 1), lane_seeds[1]),
            )
            stream = (start + index) * (3 * BOUNCE_LIMIT)
            return index + 1, total + self._arriving(first_direction, stream, lane_seeds[2], limit)

        _, total = w.loop(lambda index, _: index < end, add_sample, (start * 0, w.zero_vectors(lanes)))
        return total

    def _arriving(self, direction, stream, seed, limit):
        """One sample of the irradiance (W/m²) at the pixel centres, for one first direction in each lane."""
        w = self._wavefront

        def bounce(depth, alive, origin, direction, throughput, arriving):
            at = self._surfaces.first_along(origin, direction, alive)
            alive = alive & at.hit
            throughput = throughput * at.albedo
            arriving = arriving + w.where(alive, throughput * self._direct(at, alive), 0.0)
            depth = depth + 1
            u, v, chance = (hashed(w, stream + depth * 3 + k, seed) for k in range(3))
            largest = w.maximum(w.maximum(throughput[0], throughput[1]), throughput[2])
            survival = w.where(depth < ROULETTE_DEPTH, 1.0, w.minimum(largest, ROULETTE_SURVIVAL))
            alive = alive & (depth < limit) & (chance < survival)
            throughput = throughput / w.maximum(survival, 1e-12)
            direction = _cosine_direction(w, at.shading_normal, u, v)
            return depth, alive, at.ray_origin(w, direction), direction, throughput, arriving

        black = direction * 0.0
        start = (limit * 0, self._seen.hit & (limit > 0), self._seen.ray_origin(w, direction))
        *_, arriving = w.loop(lambda depth, alive, *_: alive, bounce, (*start, direction, black + 1.0, black))
        return arriving


def _pixel_seeds(seed: int, half: int, pixels: int) -> UInt32[np.ndarray, "pixels 3"]:
    """For each pixel: the scramble of both dimensions of its first direction, and the seed of all else."""
    return np.random.default_rng([seed, half]).integers(0, 2**32, (pixels, 3), dtype=np.uint32)


def _cosine_direction(wavefront, normal, u, v):
    """A direction about `normal` with density cos θ/π, from two numbers in [0, 1)."""
    w = wavefront
    radius, angle = w.sqrt(u), v * (2.0 * math.pi)
    x, y, z = radius * w.cos(angle), radius * w.sin(angle), w.sqrt(1.0 - u)
    # Duff et al. (2017), "Building an Orthonormal Basis, Revisited", listing 3.
    sign = w.where(normal[2] < 0.0, -1.0, 1.0)
    a = -1.0 / (sign + normal[2])
    b = normal[0] * normal[1] * a
    tangent = w.vector(1.0 + sign * normal[0] * normal[0] * a, sign * b, -sign * normal[0])
    bitangent = w.vector(b, sign + normal[1] * normal[1] * a, -normal[1])
    return tangent * x + bitangent * y + normal * z
