"""Points on glowing surfaces, drawn by area times mean radiance."""

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from vpltune.tuner.reference.running_sums import drawn, probabilities, running_sums
from vpltune.tuner.reference.surfaces import Surfaces
from vpltune.tuner.reference.unit_triangles import WRAP_MODES, UnitTriangles, srgb_decode_table

TEXEL_LOOKUPS = 2**22
"""Lookups of emission textures for the mean radiance of all triangles. A choice: some seconds at most."""
LOOKUPS_PER_TRIANGLE = (16, 1024)
"""The least and the most for a triangle. A choice: they change the noise, not the expectation."""


class GlowingSurfaces:
    """The glowing triangles of a scene, and how often each of their points is drawn."""

    def __init__(self, surfaces: Surfaces, triangles: UnitTriangles):
        wavefront = surfaces.wavefront
        self._wavefront = wavefront
        glowing = np.flatnonzero(triangles.triangle_emissions)
        areas = _areas(triangles, glowing)
        radiance = triangles.emissions[triangles.triangle_emissions[glowing], :3].astype(np.float64)
        radiance *= _mean_texels(triangles, glowing)
        sums = running_sums((areas * radiance.mean(axis=1))[None, :])
        densities = np.zeros(len(triangles.triangles))
        shares = probabilities(sums, len(glowing))[0]
        densities[glowing] = np.divide(shares, areas, out=np.zeros_like(areas), where=areas > 0.0)
        self._size = sums.shape[1]
        self._sums = wavefront.table(sums)
        self._glowing = wavefront.table(glowing.astype(np.uint32))
        self._densities = wavefront.table(densities.astype(np.float32))

    def density(self, triangle):
        """How often `point` draws a point of a triangle of the scene, per unit area in unit space."""
        return self._wavefront.take(self._densities, triangle)

    def point(self, u, v):
        """A point, from two numbers in [0, 1): its triangle, and barycentric coordinates b1 and b2."""
        w = self._wavefront
        index, u = drawn(w, self._sums, 0, self._size, u)
        root = w.sqrt(u)
        return w.take(self._glowing, index), 1.0 - root, v * root


def _areas(triangles: UnitTriangles, chosen: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    corners = triangles.positions[triangles.triangles[chosen]].astype(np.float64)
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2


def _mean_texels(triangles: UnitTriangles, chosen: Int64[np.ndarray, " n"]) -> Float64[np.ndarray, "n 3"]:
    """The mean of the emission texture over each of the triangles: 1 where there is none."""
    means = np.ones((len(chosen), 3))
    texture_of = triangles.emission_textures[triangles.triangle_emissions[chosen]]
    textured = np.flatnonzero(texture_of)
    if not textured.size:
        return means
    lookups = int(np.clip(TEXEL_LOOKUPS // textured.size, *LOOKUPS_PER_TRIANGLE))
    # Points that fill a triangle evenly: Roberts (2018), "The unreasonable effectiveness of quasirandom
    # sequences", whose R2 sequence steps by the inverse powers of the plastic number.
    u, v = np.modf(0.5 + np.arange(lookups)[:, None] * [0.7548776662466927, 0.5698402909980532])[0].T
    barycentric = np.stack([1.0 - np.sqrt(u), v * np.sqrt(u), (1.0 - v) * np.sqrt(u)], axis=1)
    at_a_time = max(1, TEXEL_LOOKUPS // lookups)
    for start in range(0, textured.size, at_a_time):
        some = textured[start : start + at_a_time]
        corners = triangles.uv[triangles.triangles[chosen[some]]].astype(np.float64)
        uv = np.einsum("ik,nkc->nic", barycentric, corners)
        means[some] = _nearest_texels(triangles, texture_of[some], uv).mean(axis=1)
    return means


def _nearest_texels(
    triangles: UnitTriangles, rows: np.ndarray, uv: Float64[np.ndarray, "n k 2"]
) -> Float32[np.ndarray, "n k 3"]:
    """The decoded texels next to each of k places in each of n textures."""
    first, width, height, *wraps = (column[:, None] for column in triangles.textures[rows].astype(np.int64).T)
    column, line = (_wrapped(uv[..., axis], size, wraps[axis]) for axis, size in enumerate((width, height)))
    packed = triangles.texels[first + line * width + column]
    return srgb_decode_table()[np.stack([packed >> shift & 255 for shift in (0, 8, 16)], axis=-1)]


def _wrapped(
    place: Float64[np.ndarray, "n k"], size: Int64[np.ndarray, "n 1"], wrap: Int64[np.ndarray, "n 1"]
) -> Int64[np.ndarray, "n k"]:
    mirrored: Bool[np.ndarray, "n 1"] = wrap == WRAP_MODES.index("mirrored_repeat")
    within = np.mod(place, np.where(mirrored, 2.0, 1.0))
    within = np.where(within > 1.0, 2.0 - within, within)
    within = np.where(wrap == WRAP_MODES.index("clamp_to_edge"), np.clip(place, 0.0, 1.0), within)
    return np.clip((within * size).astype(np.int64), 0, size - 1)
