"""Meshes of many parts at once are those of each part alone, bit by bit."""

import re
from dataclasses import replace

import numpy as np
import pytest

from vpltune.renderer.scene.files import surface_parts
from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.limits import DecodedBytes
from vpltune.renderer.scene.files.surface import Surface, finished_mesh
from vpltune.renderer.scene.files.surface_parts import Part, batches, finished_meshes

ATTRIBUTES = ("positions", "normals", "uv", "colors", "triangles")


def random_part(random: np.random.Generator, colored: bool) -> Surface:
    """Some triangles, some without area, on vertices of which some have no normal or uv."""
    vertices = int(random.integers(3, 30))
    # Few distinct positions, so that triangles without area are many.
    positions = random.integers(0, 3, (vertices, 3)).astype(np.float32)
    triangles = random.permutation(np.resize(np.arange(vertices), 3 * vertices)).reshape(-1, 3)
    normals = random.normal(size=(vertices, 3)).astype(np.float32)
    normals[random.random(vertices) < random.choice([0.0, 0.3, 1.0])] = 0.0
    return Surface(
        positions,
        triangles.astype(np.int64),
        normals if normals.any() else None,
        random.random((vertices, 2)).astype(np.float32) if random.random() < 0.5 else None,
        random.random((vertices, 3)).astype(np.float32) if colored else None,
    )


def joined(surfaces: list[Surface]) -> Surface:
    """The surfaces as one, whose absent normals and uvs are zero."""
    starts = np.cumsum([0, *(len(each.positions) for each in surfaces)])
    whole = {}
    for name, columns in (("normals", 3), ("uv", 2), ("colors", 3)):
        rows = [getattr(each, name) for each in surfaces]
        if any(each is not None for each in rows):
            whole[name] = np.concatenate(
                [
                    np.zeros((len(each.positions), columns), np.float32) if own is None else own
                    for each, own in zip(surfaces, rows, strict=True)
                ]
            )
    return Surface(
        np.concatenate([each.positions for each in surfaces]),
        np.concatenate([each.triangles + start for each, start in zip(surfaces, starts, strict=False)]),
        **whole,
    )


def parts_of(surfaces: list[Surface]) -> list[Part]:
    return [
        Part(f"part {i}", i, f"place {i}", len(each.positions), len(each.triangles), each.uv is not None)
        for i, each in enumerate(surfaces)
    ]


@pytest.mark.parametrize("seed", range(20))
def test_the_meshes_are_those_of_each_part_alone(seed):
    random = np.random.default_rng(seed)
    surfaces = [random_part(random, seed % 2 == 0) for _ in range(12)]
    # A part of which nothing is left.
    surfaces[5] = replace(surfaces[5], positions=np.zeros_like(surfaces[5].positions))
    parts = parts_of(surfaces)
    alone = [
        finished_mesh(each, part.name, part.material, DecodedBytes(), part.where)
        for each, part in zip(surfaces, parts, strict=True)
    ]
    expected = [mesh for mesh in alone if mesh is not None]
    meshes = finished_meshes(joined(surfaces), parts, DecodedBytes())
    assert len(meshes) == len(expected) < len(parts)
    for mesh, other in zip(meshes, expected, strict=True):
        assert (mesh.name, mesh.material) == (other.name, other.material)
        for name in ATTRIBUTES:
            ours, theirs = getattr(mesh, name), getattr(other, name)
            assert ours.dtype == theirs.dtype
            assert np.array_equal(ours, theirs), name


@pytest.mark.parametrize(
    ("attribute", "value", "limit"),
    [("positions", np.nan, 1e12), ("normals", np.inf, 3.4e38), ("uv", 2e9, 1e9)],
)
def test_a_refusal_names_the_part(attribute, value, limit):
    random = np.random.default_rng(1)
    surfaces = [random_part(random, False) for _ in range(4)]
    surfaces[2] = replace(
        surfaces[2],
        **{attribute: np.full((len(surfaces[2].positions), 2 + (attribute != "uv")), value, np.float32)},
    )
    said = re.escape(f"place 2: {attribute} must be finite and at most {limit:g} in magnitude, got {value:g}")
    with pytest.raises(SceneFileError, match=said):
        finished_meshes(joined(surfaces), parts_of(surfaces), DecodedBytes())


def test_the_memory_limit_holds_for_all_parts_together():
    random = np.random.default_rng(2)
    surfaces = [random_part(random, True) for _ in range(8)]
    parts = parts_of(surfaces)
    meshes = finished_meshes(joined(surfaces), parts, DecodedBytes())
    # Position, normal and colour; some parts have uvs besides.
    least = sum(36 * len(mesh.positions) + mesh.triangles.nbytes for mesh in meshes)
    with pytest.raises(SceneFileError, match=r"place [0-7]: geometry must take at most"):
        finished_meshes(joined(surfaces), parts, DecodedBytes(least - 1))


def test_batches_hold_every_part_once_in_order(monkeypatch):
    monkeypatch.setattr(surface_parts, "_BATCH", 30)
    assert [*batches([])] == []
    assert [*batches([100])] == [slice(0, 1)]
    assert [*batches([4, 6, 1, 100, 2, 3])] == [slice(0, 2), slice(2, 3), slice(3, 4), slice(4, 6)]
