"""The bounds of many instances of a large mesh: those of all its points, at the cost of a few."""

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from built_scenes import colored_room

from vpltune.renderer.scene import scene as scene_module
from vpltune.renderer.scene.scene import Instance, Scene


def turned(rng: np.random.Generator, place: np.ndarray) -> np.ndarray:
    """A rotation, a scale for each axis, and a translation."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0] * rng.uniform(0.5, 2.0, 3)
    matrix[:3, 3] = place
    return matrix


def scene_of(points: np.ndarray, matrices: np.ndarray) -> Scene:
    room = colored_room()
    triangles = np.arange(len(points) - len(points) % 3, dtype=np.int32).reshape(-1, 3)
    mesh = replace(
        room.meshes[0],
        positions=points,
        normals=np.zeros_like(points),
        triangles=triangles,
        uv=np.zeros((len(points), 2), np.float32),
        colors=np.ones_like(points),
    )
    instances = tuple(Instance(f"{i}", 0, matrix) for i, matrix in enumerate(matrices))
    return Scene("many", (mesh,), instances, room.materials)


def naive_bounds(points: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    low, high = scene_module._points_bounds(points, matrices)
    return np.stack([low, high])


@pytest.mark.parametrize("spread", [0.0, 0.1, 100.0, 1e9])
def test_bounds_are_those_of_all_points(spread):
    """To the last bit, whether the instances overlap or not: no instance is left out that matters."""
    rng = np.random.default_rng(3)
    points = rng.normal(size=(60, 3)).astype(np.float32)
    matrices = np.array([turned(rng, spread * rng.normal(size=3)) for _ in range(500)])
    bounds = scene_of(points, matrices).bounds()
    placed = (
        np.einsum("kij,nj->kni", matrices[:, :3, :3], points.astype(np.float64)) + matrices[:, None, :3, 3]
    )
    # Two ways to sum three products differ by rounding.
    np.testing.assert_allclose(bounds[0], placed.min(axis=(0, 1)), rtol=1e-14, atol=1e-14)
    np.testing.assert_allclose(bounds[1], placed.max(axis=(0, 1)), rtol=1e-14, atol=1e-14)
    np.testing.assert_array_equal(bounds, naive_bounds(points, matrices))


def test_many_instances_of_a_large_mesh_cost_a_few():
    """100 million placed vertices. A quarter of the processor time of placing them all is a wide margin: some
    twenty of 2,000 instances reach out of the box of the others here."""
    rng = np.random.default_rng(4)
    points = rng.normal(size=(50_000, 3)).astype(np.float32)
    matrices = np.array([turned(rng, 1000.0 * rng.uniform(size=3)) for _ in range(2000)])
    scene = scene_of(points, matrices)

    def seconds(work: Callable[[], object]) -> float:
        begin = time.process_time()
        work()
        return time.process_time() - begin

    all_placed = min(seconds(lambda: naive_bounds(points, matrices)) for _ in range(3))
    assert min(seconds(scene.bounds) for _ in range(3)) < 0.25 * all_placed
