"""Accessors: component types, strides, normalisation and sparse substitution give the right numbers."""

import numpy as np
import pytest

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene

TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)


def read_positions(gltf):
    """The triangle corners of the only mesh, in drawing order."""
    (mesh,) = read_scene(gltf.write()).meshes
    return mesh.positions[mesh.triangles].reshape(-1, 3)


@pytest.mark.parametrize("dtype", ["i1", "u1", "i2", "u2", "u4", "f4"])
def test_positions_of_every_component_type(gltf, dtype):
    positions = np.array([[3, 0, 0], [5, 0, 0], [3, 7, 100]], dtype)
    gltf.add_primitive(positions)
    np.testing.assert_array_equal(read_positions(gltf), positions)


@pytest.mark.parametrize(
    ("dtype", "stored", "meant"),
    [
        # glTF 2.0 section 3.11: unsigned c/255, c/65535; signed max(c/127, −1), max(c/32767, −1).
        ("u1", [0, 51, 255], [0.0, 0.2, 1.0]),
        ("u2", [0, 13107, 65535], [0.0, 0.2, 1.0]),
        ("i1", [-128, -127, 127], [-1.0, -1.0, 1.0]),
        ("i2", [-32768, -32767, 32767], [-1.0, -1.0, 1.0]),
    ],
)
def test_normalised_integers(gltf, dtype, stored, meant):
    positions = np.zeros((4, 3), dtype)
    positions[:3, 0] = stored
    positions[3, 1] = 1
    gltf.add_primitive(positions, indices=np.array([0, 1, 3, 1, 2, 3], np.uint8))
    gltf.document["accessors"][0]["normalized"] = True
    corners = read_positions(gltf)
    # 1e-7: one rounding of float32.
    assert corners[:, 0].min() == pytest.approx(min(meant), abs=1e-7)
    assert corners[:, 0].max() == pytest.approx(max(meant), abs=1e-7)
    assert any(abs(x - meant[1]) < 1e-7 for x in corners[:, 0])


def test_byte_stride_and_offset_pick_interleaved_attributes(gltf):
    normals = np.array([[0, 0, 2], [0, 3, 0], [4, 0, 0]], np.float32)
    interleaved = np.concatenate([TRIANGLE, normals], axis=1)
    primitive = gltf.add_primitive()
    view = gltf.view(b"\xff" * 8 + interleaved.tobytes(), byteStride=24)
    shared = {"bufferView": view, "componentType": 5126, "count": 3, "type": "VEC3"}
    primitive["attributes"]["POSITION"] = gltf.add("accessors", shared | {"byteOffset": 8})
    primitive["attributes"]["NORMAL"] = gltf.add("accessors", shared | {"byteOffset": 20})
    (mesh,) = read_scene(gltf.write()).meshes
    np.testing.assert_array_equal(mesh.positions, TRIANGLE)
    np.testing.assert_array_equal(mesh.normals, [[0, 0, 1], [0, 1, 0], [1, 0, 0]])


@pytest.mark.parametrize("has_base", [True, False])
@pytest.mark.parametrize("index_dtype", ["u1", "u2", "u4"])
def test_sparse_accessors_replace_what_they_name(triangle, has_base, index_dtype):
    accessor = triangle.document["accessors"][0]
    rows, values = [1, 2], np.array([[9, 0, 0], [0, 9, 9]], np.float32)
    component_type = {"u1": 5121, "u2": 5123, "u4": 5125}[index_dtype]
    accessor["sparse"] = {
        "count": 2,
        "indices": {
            "bufferView": triangle.view(np.array(rows, index_dtype).tobytes()),
            "componentType": component_type,
        },
        "values": {"bufferView": triangle.view(values.tobytes())},
    }
    if not has_base:
        del accessor["bufferView"]
    np.testing.assert_array_equal(read_positions(triangle), [[0, 0, 0], [9, 0, 0], [0, 9, 9]])


def test_a_sparse_index_beyond_the_accessor_is_refused(triangle):
    triangle.document["accessors"][0]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": triangle.view(b"\x03"), "componentType": 5121},
        "values": {"bufferView": triangle.view(bytes(12))},
    }
    with pytest.raises(
        InputError, match=r"accessors\[0\]\.sparse\.indices: must rise strictly and stay below"
    ):
        read_scene(triangle.write())


def test_a_small_part_of_a_large_vertex_buffer_is_all_that_is_kept(gltf):
    positions = np.random.default_rng(1).uniform(size=(5000, 3)).astype(np.float32)
    normals = np.tile(np.array([0, 0, 1], np.float32), (5000, 1))
    gltf.add_primitive(positions, indices=np.array([4321, 7, 1234], np.uint16), NORMAL=normals)
    (mesh,) = read_scene(gltf.write()).meshes
    assert len(mesh.positions) == 3
    np.testing.assert_array_equal(mesh.positions[mesh.triangles[0]], positions[[4321, 7, 1234]])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 4}, "its 4 elements end at byte 48, beyond the bufferView's 36 bytes"),
        ({"count": 10**9}, "end at byte 12000000000"),
        ({"byteOffset": 4}, "end at byte 40"),
        ({"count": 0}, "count: must be a whole number of at least 1, got 0"),
        ({"count": 2.5}, "count: must be a whole number of at least 1, got 2.5"),
        ({"componentType": 5124}, "componentType: must be one of"),
        ({"type": "VEC2"}, "POSITION must be VEC3, got 'VEC2'"),
        ({"bufferView": 9}, "must be an index into the 1 bufferViews, got 9"),
        ({"bufferView": -1}, "must be an index into the 1 bufferViews, got -1"),
    ],
)
def test_broken_accessors_are_refused(triangle, change, message):
    triangle.document["accessors"][0] |= change
    with pytest.raises(InputError, match=r"scene\.gltf: accessors\[0\].*" + message):
        read_scene(triangle.write())


def test_zeros_for_the_asking_are_refused_before_they_are_made(triangle):
    del triangle.document["accessors"][0]["bufferView"]
    triangle.document["accessors"][0]["count"] = 10**8
    with pytest.raises(InputError, match="at most 512 MiB once decoded"):
        read_scene(triangle.write())


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_positions_that_are_no_place_are_refused(gltf, value):
    positions = TRIANGLE.copy()
    positions[1, 1] = value
    gltf.add_primitive(positions)
    with pytest.raises(InputError, match="must be finite"):
        read_scene(gltf.write())


@pytest.mark.parametrize(
    ("indices", "message"),
    [
        (np.array([0, 1, 3], np.uint8), "must be below the 3 vertices, got 3"),
        (np.array([0, 1, 255], np.uint8), "must not hold 255, which means primitive restart"),
        (np.array([0, 1, 2, 0], np.uint16), "multiple of 3 corners, got 4"),
        (np.array([0, 1, 2], np.float32), "plain unsigned integers, got float32"),
    ],
)
def test_broken_indices_are_refused(gltf, indices, message):
    gltf.add_primitive(indices=indices)
    with pytest.raises(InputError, match=message):
        read_scene(gltf.write())


def test_attributes_of_differing_counts_are_refused(gltf):
    gltf.add_primitive(NORMAL=np.ones((2, 3), np.float32))
    with pytest.raises(InputError, match="NORMAL must have the 3 elements of POSITION, got 2"):
        read_scene(gltf.write())
