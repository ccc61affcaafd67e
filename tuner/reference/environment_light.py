"""The environment's radiance along directions, and directions drawn by radiance times solid angle."""

import math

import numpy as np

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.environment import Environment, solid_angles
from vpltune.tuner.reference.running_sums import drawn, probabilities, running_sums


class EnvironmentLight:
    """An equirectangular map on a wavefront; even within each texel."""

    def __init__(self, wavefront, environment: Environment):
        self._wavefront = wavefront
        radiance = environment.radiance
        self._height, self._width = radiance.shape[:2]
        if not radiance.size or not (np.isfinite(radiance).all() and radiance.min() >= 0.0):
            raise InputError("environment: radiance must be finite and at least 0, in one texel or more")
        angles = solid_angles(self._height, self._width)
        weights = radiance.mean(axis=2, dtype=np.float64) * angles[:, None]
        rows, columns = running_sums(weights.sum(axis=1)[None, :]), running_sums(weights)
        shares = probabilities(rows, self._height).T * probabilities(columns, self._width)
        densities = (shares / angles[:, None]).astype(np.float32)
        self._rows, self._columns = wavefront.table(rows), wavefront.table(columns)
        self._row_size, self._column_size = rows.shape[1], columns.shape[1]
        self._texels = wavefront.table(np.concatenate([radiance, densities[..., None]], axis=2))
        self._edges = wavefront.table(
            np.cos(np.pi * np.arange(self._height + 1) / self._height).astype(np.float32)
        )

    def arriving(self, direction):
        """Radiance from the way that a unit vector points, RGB in W/(m² sr), and how often `direction` draws
        it, per steradian."""
        w = self._wavefront
        # An arctangent keeps its digits near the poles, where an arccosine would lose half of them.
        across = w.sqrt(w.maximum(1.0 - direction[1] * direction[1], 0.0))
        row = self._texel(w.atan2(across, direction[1]) / math.pi, self._height)
        turn = w.atan2(direction[0], -direction[2]) / (2.0 * math.pi)
        column = self._texel(turn - w.floor(turn), self._width)
        red, green, blue, density = (
            w.take(self._texels, (row * self._width + column) * 4 + k) for k in range(4)
        )
        return w.vector(red, green, blue), density

    def _texel(self, place, size: int):
        w = self._wavefront
        return w.to_index(w.minimum(w.maximum(w.floor(place * size), 0.0), size - 1.0))

    def direction(self, u, v):
        """A unit vector towards the environment, from two numbers in [0, 1)."""
        w = self._wavefront
        row, down = drawn(w, self._rows, 0, self._row_size, u)
        column, along = drawn(w, self._columns, row * self._column_size, self._column_size, v)
        upper, lower = w.take(self._edges, row), w.take(self._edges, row + 1)
        height = upper + (lower - upper) * down
        across = w.sqrt(w.maximum(1.0 - height * height, 0.0))
        azimuth = (w.to_number(column) + along) * (2.0 * math.pi / self._width)
        return w.vector(across * w.sin(azimuth), height, -across * w.cos(azimuth))
