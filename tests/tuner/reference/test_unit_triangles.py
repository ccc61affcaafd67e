"""Unit space, and the rejection of scenes on which Mitsuba would crash."""

from dataclasses import replace

import numpy as np
import pytest

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.scene import Material
from vpltune.tuner.reference.unit_triangles import unit_triangles


def with_mesh(scene, **changes):
    return replace(scene, meshes=(replace(scene.meshes[0], **changes), *scene.meshes[1:]))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"triangles": np.array([[0, 1, 4]], np.int32)}, r"indices must lie in \[0, 4\), got 0 to 4"),
        ({"triangles": np.array([[0, -1, 2]], np.int32)}, "got -1 to 2"),
        ({"positions": np.full((4, 3), np.nan, np.float32)}, "positions must be finite"),
        ({"uv": np.full((4, 2), np.inf, np.float32)}, "uv must be finite"),
        ({"material": 3}, r"material must lie in \[0, 3\), got 3"),
    ],
)
def test_meshes_that_are_refused(shapes, changes, message):
    with pytest.raises(InputError, match=f"box room: mesh 'floor'.*{message}"):
        unit_triangles(with_mesh(shapes.box_room(), **changes))


def test_scenes_that_are_refused(shapes):
    room = shapes.box_room()
    with pytest.raises(InputError, match="at least one triangle"):
        unit_triangles(replace(room, instances=()))
    with pytest.raises(InputError, match=r"texture must lie in \[0, 0\), got 2"):
        textured = (Material("m", np.ones(3, np.float32), 2), *room.materials[1:])
        unit_triangles(replace(room, materials=textured))
    flat = replace(room, instances=(replace(room.instances[0], to_world=np.diag([0.0, 0.0, 0.0, 1.0])),))
    with pytest.raises(InputError, match="extent must be positive"):
        unit_triangles(flat)


def test_unit_space_is_centred_with_a_diagonal_of_one(shapes):
    room = shapes.box_room()
    triangles = unit_triangles(room)
    low, high = triangles.positions.min(axis=0), triangles.positions.max(axis=0)
    assert np.linalg.norm(high - low) == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(low, -high, atol=1e-6)
    np.testing.assert_allclose(
        triangles.to_unit(room.bounds()), np.stack([low, high]).astype(np.float64), atol=1e-6
    )
    assert triangles.diagonal == pytest.approx(np.sqrt(12.0))


def test_mirrored_and_stretched_instances_keep_normals_across_their_surfaces(shapes):
    room = shapes.box_room()
    to_world = np.diag([-2.0, 0.5, 3.0, 1.0])
    to_world[:3, :3] @= np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    moved = replace(room, instances=tuple(replace(i, to_world=to_world @ i.to_world) for i in room.instances))
    triangles = unit_triangles(moved)
    for corner in range(3):
        normals = triangles.normals[triangles.triangles[:, corner]]
        along = np.abs(np.sum(normals * triangles.geometric_normals, axis=1))
        np.testing.assert_allclose(along, 1.0, atol=1e-5)
