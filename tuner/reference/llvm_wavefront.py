"""Array arithmetic and ray casts on Dr.Jit's LLVM backend, which fuses a whole estimator into one kernel.

`LlvmWavefront` and `NumpyWavefront` have the same methods, so the estimator is written once. An *array* holds
one number per lane, a *vector* three. A *table* is a flat buffer for lookups.
"""

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from jaxtyping import Float, Float32, UInt32

from vpltune.tuner.reference.unit_triangles import UnitTriangles

Array = Any
Vector = Any


class LlvmWavefront:
    """Arithmetic on many lanes at once, and rays against the triangles of one scene."""

    def __init__(self, triangles: UnitTriangles):
        self._scene = mitsuba_scene(triangles, mi.Float, mi.UInt32)

    def table(self, values: Float32[np.ndarray, "*n"] | UInt32[np.ndarray, "*n"]) -> Array:
        """A flat copy of `values`. Used as an array, a table of one number broadcasts to all lanes."""
        kind = mi.UInt32 if values.dtype == np.uint32 else mi.Float
        return kind(np.ascontiguousarray(values).ravel())

    def vectors(self, values: Float[np.ndarray, "lanes 3"]) -> Vector:
        """One vector per lane, as float32."""
        return mi.Vector3f(np.ascontiguousarray(values.T, dtype=np.float32))

    def take(self, table: Array, index: Array) -> Array:
        """The number at `index` of a table, for each lane."""
        return dr.gather(type(table), table, index)

    def take_vector(self, table: Array, index: Array) -> Vector:
        """The vector at `index` of a table: numbers 3·index, 3·index + 1 and 3·index + 2."""
        return dr.gather(mi.Vector3f if type(table) is mi.Float else mi.Vector3u, table, index)

    def loop(self, condition: Callable[..., Any], body: Callable[..., tuple], state: tuple) -> tuple:
        """Run `state = body(*state)` while `condition(*state)`, for each lane on its own; the last state."""
        return dr.while_loop(state, condition, body)

    def closest_hit(
        self, origin: Vector, direction: Vector, active: Array, max_t: Array | None = None
    ) -> tuple[Array, Array, Array, Array]:
        """The first hit of each active ray: (whether it hits, triangle, barycentric b1, barycentric b2).

        The last three are 0 on a miss. A ray ends at `max_t` times the length of `direction`, if given.
        """
        ray = mi.Ray3f(mi.Point3f(origin), direction)
        if max_t is not None:
            ray.maxt = max_t
        found = self._scene.ray_intersect_preliminary(ray, coherent=False, active=active)
        hit = active & found.is_valid()
        triangle = dr.select(hit, found.prim_index, mi.UInt32(0))
        # Mitsuba leaves the coordinates undefined on a miss.
        return hit, triangle, dr.select(hit, found.prim_uv.x, 0.0), dr.select(hit, found.prim_uv.y, 0.0)

    def occluded(self, origin: Vector, direction: Vector, max_t: Array, active: Array) -> Array:
        """Whether a triangle blocks each active ray within `max_t` times the length of `direction`."""
        ray = mi.Ray3f(mi.Point3f(origin), direction)
        ray.maxt = max_t
        return self._scene.ray_test(ray, coherent=False, active=active)

    def lanes(self, count: int) -> Array:
        """Lane indices 0 … `count` − 1, uint32."""
        return dr.arange(mi.UInt32, count)

    def all_true(self, count: int) -> Array:
        """True in each of `count` lanes."""
        return dr.full(mi.Bool, True, count)

    def zero_vectors(self, count: int) -> Vector:
        """The zero vector in each of `count` lanes."""
        return dr.zeros(mi.Vector3f, count)

    def vector(self, x: Array, y: Array, z: Array) -> Vector:
        """The vector (x, y, z) in each lane."""
        return mi.Vector3f(x, y, z)

    def bits(self, number: Array) -> Array:
        """The bits of float32 as uint32."""
        return dr.reinterpret_array(mi.UInt32, number)

    def to_index(self, number: Array) -> Array:
        """Convert float32 to uint32, truncating."""
        return mi.UInt32(number)

    def to_number(self, index: Array) -> Array:
        """Convert uint32 to float32."""
        return mi.Float(index)

    def to_numpy(self, array: Array | Vector) -> np.ndarray:
        """Convert to numpy, [lanes] or [lanes, 3]. This runs the pending kernel."""
        return np.array(array).T

    def evaluate(self, *arrays: Array | Vector) -> None:
        """Compute `arrays` now, so that later kernels read their values and do not recompute them."""
        dr.eval(*arrays)

    def run(self, work: Callable[[], Any]) -> Any:
        """Call `work`, which records or runs arithmetic, and return its result."""
        return work()

    dot = staticmethod(dr.dot)
    where = staticmethod(dr.select)
    minimum = staticmethod(dr.minimum)
    maximum = staticmethod(dr.maximum)
    sqrt = staticmethod(dr.sqrt)
    floor = staticmethod(dr.floor)
    sin = staticmethod(dr.sin)
    cos = staticmethod(dr.cos)
    atan2 = staticmethod(dr.atan2)


def mitsuba_scene(triangles: UnitTriangles, floats: type, uints: type) -> Any:
    """A Mitsuba scene with one mesh. It has no vertex normals, since only its intersections are used.

    Embree's robust mode is on, so that rays do not slip between adjacent triangles. `floats` and `uints` are
    the array types of the current variant.
    """
    mesh = mi.Mesh("triangles", len(triangles.positions), len(triangles.triangles))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = floats(triangles.positions.ravel())
    parameters["faces"] = uints(triangles.triangles.ravel())
    parameters.update()
    return mi.load_dict({"type": "scene", "embree_use_robust_intersections": True, "mesh": mesh})
