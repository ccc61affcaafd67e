"""The methods of `LlvmWavefront` in numpy, for machines without a usable LLVM library.

Mitsuba's scalar variant casts the rays one by one. All other arithmetic is vectorised. Vectors are
[3, lanes].
"""

from collections.abc import Callable
from typing import Any

import drjit.scalar
import mitsuba as mi
import numpy as np

from vpltune.tuner.reference.llvm_wavefront import mitsuba_scene
from vpltune.tuner.reference.unit_triangles import UnitTriangles


class NumpyWavefront:
    """Arithmetic on many lanes at once, and rays against the triangles of one scene.

    `LlvmWavefront` has the same methods and describes their arguments.
    """

    def __init__(self, triangles: UnitTriangles):
        self._scene = mitsuba_scene(triangles, drjit.scalar.ArrayXf, drjit.scalar.ArrayXu)

    def table(self, values):
        """A flat copy of `values`."""
        return np.ascontiguousarray(values).ravel()

    def vectors(self, values):
        """[lanes, 3] values as vectors, float32."""
        return np.ascontiguousarray(values.T, dtype=np.float32)

    def take(self, table, index):
        """The number at `index` of a table, for each lane."""
        return table[index]

    def take_vector(self, table, index):
        """The vector at `index` of a table: numbers 3·index, 3·index + 1 and 3·index + 2."""
        return np.ascontiguousarray(table.reshape(-1, 3)[index].T)

    def loop(self, condition: Callable[..., Any], body: Callable[..., tuple], state: tuple) -> tuple:
        """Run `state = body(*state)` while `condition(*state)`, for each lane on its own; the last state."""
        while True:
            going = condition(*state)
            if not np.any(going):
                return state
            state = _advanced(going, body(*state), state)

    def closest_hit(self, origin, direction, active, max_t=np.inf):
        """The first hit of each active ray: (whether it hits, triangle, barycentric b1, barycentric b2)."""
        lanes = direction.shape[1]
        hit = np.zeros(lanes, bool)
        triangle = np.zeros(lanes, np.uint32)
        b1, b2 = np.zeros((2, lanes), np.float32)
        limits = np.broadcast_to(max_t, hit.shape)
        for lane, ray in self._rays(origin, direction, active):
            # Mitsuba's type stubs are those of its vectorised variants.
            ray.maxt = float(limits[lane])  # pyright: ignore[reportAttributeAccessIssue]
            found = self._scene.ray_intersect_preliminary(ray, coherent=False, active=True)
            if found.is_valid():
                hit[lane] = True
                triangle[lane] = found.prim_index
                b1[lane], b2[lane] = found.prim_uv
        return hit, triangle, b1, b2

    def occluded(self, origin, direction, max_t, active):
        """Whether a triangle blocks each active ray within `max_t` times the length of `direction`."""
        blocked = np.zeros(direction.shape[1], bool)
        limits = np.broadcast_to(max_t, blocked.shape)
        for lane, ray in self._rays(origin, direction, active):
            # Mitsuba's type stubs are those of its vectorised variants.
            ray.maxt = float(limits[lane])  # pyright: ignore[reportAttributeAccessIssue]
            blocked[lane] = self._scene.ray_test(ray, coherent=False, active=True)
        return blocked

    def _rays(self, origin, direction, active):
        lanes = np.flatnonzero(np.broadcast_to(active, direction.shape[1:]))
        origins = np.broadcast_to(origin, direction.shape)[:, lanes].T.tolist()
        directions = direction[:, lanes].T.tolist()
        for lane, start, way in zip(lanes.tolist(), origins, directions, strict=True):
            yield lane, mi.Ray3f(start, way)

    def lanes(self, count):
        """Lane indices 0 … `count` − 1, uint32."""
        return np.arange(count, dtype=np.uint32)

    def all_true(self, count):
        """True in each of `count` lanes."""
        return np.ones(count, bool)

    def zero_vectors(self, count):
        """The zero vector in each of `count` lanes."""
        return np.zeros((3, count), np.float32)

    def vector(self, x, y, z):
        """The vector (x, y, z) in each lane."""
        return np.stack(np.broadcast_arrays(x, y, z))

    def bits(self, number):
        """The bits of float32 as uint32."""
        return np.ascontiguousarray(number, np.float32).view(np.uint32)

    def to_index(self, number):
        """Convert float32 to uint32, truncating."""
        return np.asarray(number).astype(np.uint32)

    def to_number(self, index):
        """Convert uint32 to float32."""
        return np.asarray(index).astype(np.float32)

    def to_numpy(self, array):
        """Convert to [lanes] or [lanes, 3]."""
        return np.asarray(array).T

    def evaluate(self, *arrays):
        """Do nothing: numpy has already computed `arrays`."""

    def run(self, work):
        """Call `work` without floating-point errors: masked-out lanes may divide by zero, as in a kernel."""
        with np.errstate(all="ignore"):
            return work()

    def where(self, condition, chosen, otherwise):
        """`chosen` where `condition` holds, else `otherwise`; floats stay float32."""
        values = np.where(condition, chosen, otherwise)
        return values.astype(np.float32) if values.dtype == np.float64 else values

    def dot(self, a, b):
        """Dot product of two vectors in each lane."""
        return np.sum(a * b, axis=0, dtype=np.float32)

    minimum = staticmethod(np.minimum)
    maximum = staticmethod(np.maximum)
    sqrt = staticmethod(np.sqrt)
    floor = staticmethod(np.floor)
    sin = staticmethod(np.sin)
    cos = staticmethod(np.cos)
    atan2 = staticmethod(np.arctan2)


def _advanced(going, new, old):
    """`new` in the lanes where `going` is true, `old` in the others; recurses into nested tuples."""
    if isinstance(old, tuple):
        return tuple(_advanced(going, *pair) for pair in zip(new, old, strict=True))
    return np.where(going, new, old)
