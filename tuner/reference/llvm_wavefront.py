"""Array arithmetic and ray casts on Dr.Jit's LLVM backend: a whole estimator becomes one fused kernel.

`LlvmWavefront` and `NumpyWavefront` offer the same methods, so that the estimator is written once.
An array is one number per lane, a vector three of them, a table a flat buffer to look numbers up in.
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
    """Rays against one scene's triangles, many lanes at once."""

    def __init__(self, triangles: UnitTriangles):
        self._scene = mitsuba_scene(triangles, mi.Float, mi.UInt32)

    def table(self, values: Float32[np.ndarray, "*n"] | UInt32[np.ndarray, "*n"]) -> Array:
        """Numbers to look up, or one per lane; a table of one number is the same for all lanes."""
        kind = mi.UInt32 if values.dtype == np.uint32 else mi.Float
        return kind(np.ascontiguousarray(values).ravel())

    def vectors(self, values: Float[np.ndarray, "lanes 3"]) -> Vector:
        """One vector per lane."""
        return mi.Vector3f(np.ascontiguousarray(values.T, dtype=np.float32))

    def take(self, table: Array, index: Array) -> Array:
        return dr.gather(type(table), table, index)

    def take_vector(self, table: Array, index: Array) -> Vector:
        """Numbers 3·index, 3·index + 1 and 3·index + 2."""
        return dr.gather(mi.Vector3f if type(table) is mi.Float else mi.Vector3u, table, index)

    def loop(self, condition: Callable[..., Any], body: Callable[..., tuple], state: tuple) -> tuple:
        """While `condition(*state)`, `state = body(*state)`; a lane that is done stands still."""
        return dr.while_loop(state, condition, body)

    def closest_hit(
        self, origin: Vector, direction: Vector, active: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Whether each ray hits, the triangle it hits first (0 if none), and its barycentric b1 and b2."""
        ray = mi.Ray3f(mi.Point3f(origin), direction)
        found = self._scene.ray_intersect_preliminary(ray, coherent=False, active=active)
        hit = active & found.is_valid()
        triangle = dr.select(hit, found.prim_index, mi.UInt32(0))
        # What a miss leaves in the coordinates is not defined.
        return hit, triangle, dr.select(hit, found.prim_uv.x, 0.0), dr.select(hit, found.prim_uv.y, 0.0)

    def occluded(self, origin: Vector, direction: Vector, max_t: Array, active: Array) -> Array:
        """Whether anything stands within `max_t` lengths of `direction`."""
        ray = mi.Ray3f(mi.Point3f(origin), direction)
        ray.maxt = max_t
        return self._scene.ray_test(ray, coherent=False, active=active)

    def lanes(self, count: int) -> Array:
        """The number of each lane, from 0."""
        return dr.arange(mi.UInt32, count)

    def all_true(self, count: int) -> Array:
        return dr.full(mi.Bool, True, count)

    def zero_vectors(self, count: int) -> Vector:
        return dr.zeros(mi.Vector3f, count)

    def vector(self, x: Array, y: Array, z: Array) -> Vector:
        return mi.Vector3f(x, y, z)

    def to_index(self, number: Array) -> Array:
        return mi.UInt32(number)

    def to_number(self, index: Array) -> Array:
        return mi.Float(index)

    def to_numpy(self, array: Array | Vector) -> np.ndarray:
        """[lanes] or [lanes, 3]. Runs what is pending; an interrupt is heard between kernels."""
        return np.array(array).T

    def evaluate(self, *arrays: Array | Vector) -> None:
        """Compute `arrays` now, so that later kernels start from their values."""
        dr.eval(*arrays)

    def run(self, work: Callable[[], Any]) -> Any:
        return work()

    dot = staticmethod(dr.dot)
    where = staticmethod(dr.select)
    minimum = staticmethod(dr.minimum)
    maximum = staticmethod(dr.maximum)
    sqrt = staticmethod(dr.sqrt)
    floor = staticmethod(dr.floor)
    sin = staticmethod(dr.sin)
    cos = staticmethod(dr.cos)


def mitsuba_scene(triangles: UnitTriangles, floats: type, uints: type) -> Any:
    """A Mitsuba scene of one mesh without vertex normals: only its intersections are used.

    Embree's robust mode is on, so that rays do not slip between neighbouring triangles.
    """
    mesh = mi.Mesh("triangles", len(triangles.positions), len(triangles.triangles))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = floats(triangles.positions.ravel())
    parameters["faces"] = uints(triangles.triangles.ravel())
    parameters.update()
    return mi.load_dict({"type": "scene", "embree_use_robust_intersections": True, "mesh": mesh})
