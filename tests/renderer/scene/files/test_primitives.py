"""Primitives: strips, fans, normals, colours and compression, compared with known numbers."""

import DracoPy
import numpy as np
import pytest

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene

# A fan around its first point, and a zigzag strip.
FAN = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], np.float32)
STRIP = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0]], np.float32)


def corners_of(mesh):
    return mesh.positions[mesh.triangles]


def geometric_normals(mesh):
    a, b, c = corners_of(mesh).astype(np.float64).transpose(1, 0, 2)
    cross = np.cross(b - a, c - a)
    return cross / np.linalg.norm(cross, axis=1, keepdims=True)


@pytest.mark.parametrize(("mode", "points", "area"), [(5, STRIP, 1.5), (6, FAN, 2.0)])
@pytest.mark.parametrize("is_indexed", [True, False])
def test_strips_and_fans_face_one_way(gltf, mode, points, area, is_indexed):
    indices = np.arange(len(points), dtype=np.uint16) if is_indexed else None
    gltf.add_primitive(points, indices)["mode"] = mode
    (mesh,) = read_scene(gltf.write()).meshes
    assert len(mesh.triangles) == len(points) - 2
    np.testing.assert_allclose(geometric_normals(mesh), [[0, 0, 1]] * (len(points) - 2), atol=1e-12)
    a, b, c = corners_of(mesh).transpose(1, 0, 2)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(area)


def test_without_normals_a_mesh_is_flat_and_shares_no_vertices(gltf):
    tetrahedron = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    faces = np.array([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], np.uint8)
    gltf.add_primitive(tetrahedron, faces)
    (mesh,) = read_scene(gltf.write()).meshes
    assert len(mesh.positions) == 12
    for corner in range(3):
        # 1e-7: the rounding to float32.
        np.testing.assert_allclose(
            mesh.normals[mesh.triangles[:, corner]], geometric_normals(mesh), atol=1e-7
        )


def test_given_normals_are_normalised_and_shared(gltf):
    normals = np.array([[0, 0, 5], [3, 0, 4], [0, 0, 1e-3], [0, 0, 1]], np.float32)
    gltf.add_primitive(FAN, np.array([0, 1, 2, 0, 2, 3], np.uint8), NORMAL=normals)
    (mesh,) = read_scene(gltf.write()).meshes
    assert len(mesh.positions) == 4
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1], [0.6, 0, 0.8], [0, 0, 1], [0, 0, 1]], atol=1e-7)


def test_a_zero_normal_takes_its_triangles_and_leaves_the_others_alone(gltf):
    # Two triangles at a right angle share an edge; the shared vertex 0 has no normal.
    positions = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1]], np.float32)
    normals = np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0], [0, 0, 1]], np.float32)
    gltf.add_primitive(positions, np.array([0, 2, 1, 0, 1, 3], np.uint8), NORMAL=normals)
    (mesh,) = read_scene(gltf.write()).meshes
    np.testing.assert_array_equal(corners_of(mesh), positions[[[0, 2, 1], [0, 1, 3]]])
    np.testing.assert_array_equal(mesh.normals[mesh.triangles[:, 0]], [[0, 0, 1], [1, 0, 0]])
    np.testing.assert_array_equal(mesh.normals[mesh.triangles[0, 1:]], normals[[2, 1]])
    np.testing.assert_array_equal(mesh.normals[mesh.triangles[1, 1:]], normals[[1, 3]])


def test_triangles_without_area_go_and_a_scene_of_them_is_refused(gltf):
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]], np.float32)
    primitive = gltf.add_primitive(points, np.array([0, 1, 2, 0, 1, 3, 1, 1, 3], np.uint8))
    (mesh,) = read_scene(gltf.write()).meshes
    np.testing.assert_array_equal(corners_of(mesh), [points[[0, 1, 3]]])
    primitive["indices"] = gltf.accessor(np.array([0, 1, 2], np.uint8))
    with pytest.raises(InputError, match="has no triangles"):
        read_scene(gltf.write())


@pytest.mark.parametrize(
    ("colors", "is_normalized"),
    [
        (np.array([[0.25, 0.5, 1.0]] * 3, np.float32), False),
        (np.array([[0.25, 0.5, 1.0, 0.0]] * 3, np.float32), False),
        (np.array([[16384, 32768, 65535, 7]] * 3, np.uint16), True),
        (np.array([[64, 128, 255]] * 3, np.uint8), True),
    ],
)
def test_vertex_colours_are_linear_and_their_alpha_is_left_aside(gltf, colors, is_normalized):
    gltf.add_primitive(COLOR_0=colors)
    gltf.document["accessors"][-1]["normalized"] = is_normalized
    scene = read_scene(gltf.write())
    # 2e-3: half a step of eight bits.
    np.testing.assert_allclose(scene.meshes[0].colors, [[0.25, 0.5, 1.0]] * 3, atol=2e-3)
    assert scene.warnings == ()


@pytest.mark.parametrize(
    ("mode", "alpha", "said"),
    [
        ("BLEND", [1.0, 0.5, 1.0], True),
        ("MASK", [1.0, 0.0, 1.0], True),
        ("BLEND", [1.0, 1.0, 1.0], False),
        ("OPAQUE", [1.0, 0.5, 1.0], False),
    ],
)
def test_alpha_of_vertex_colours_gets_a_word_where_it_would_count(gltf, mode, alpha, said):
    colors = np.column_stack([np.ones((3, 3)), alpha]).astype(np.float32)
    gltf.add_primitive(COLOR_0=colors)["material"] = gltf.add("materials", {"alphaMode": mode})
    warnings = read_scene(gltf.write()).warnings
    assert warnings == (("1 primitive has vertex colours with alpha; alpha counts as 1",) if said else ())


def test_vertex_colours_beyond_one_are_clamped_aloud(gltf):
    gltf.add_primitive(COLOR_0=np.full((3, 3), 1.5, np.float32))
    scene = read_scene(gltf.write())
    np.testing.assert_array_equal(scene.meshes[0].colors, 1.0)
    assert scene.warnings == ("1 primitive has vertex colours outside [0, 1]; they are clamped",)


def test_points_and_lines_are_left_out_aloud(triangle):
    for mode in (0, 1, 2, 3):
        triangle.add_primitive()["mode"] = mode
    scene = read_scene(triangle.write())
    assert scene.triangle_count() == 1
    assert scene.warnings == ("4 primitives of points or lines are ignored",)


def test_one_mesh_serves_all_nodes_that_show_it(triangle):
    triangle.document["nodes"] = [{"mesh": 0, "translation": [i, 0, 0], "name": f"n{i}"} for i in range(3)]
    triangle.document["scenes"] = [{"nodes": [0, 1, 2]}]
    scene = read_scene(triangle.write())
    assert len(scene.meshes) == 1
    assert [instance.name for instance in scene.instances] == ["n0", "n1", "n2"]
    assert [instance.to_world[0, 3] for instance in scene.instances] == [0, 1, 2]


class TestDraco:
    POSITIONS = np.random.default_rng(2).uniform(-1, 1, (30, 3)).astype(np.float32)
    FACES = np.random.default_rng(3).permutation(30).reshape(-1, 3).astype(np.uint32)

    def compressed(self, gltf, unique_id=7, **changes):
        """A primitive whose colours have an attribute id that differs from their position in the list."""
        colors = np.stack([np.arange(30), np.full(30, 128), np.full(30, 255)], axis=1).astype(np.uint8)
        stream = DracoPy.encode(
            self.POSITIONS,
            self.FACES,
            quantization_bits=20,
            preserve_order=True,
            generic_attributes={unique_id: colors},
        )
        ids = {a["unique_id"]: a["data"].shape for a in DracoPy.decode(stream).attributes}
        position_id = next(i for i in ids if i != unique_id)
        accessor = {"componentType": 5126, "count": 30, "type": "VEC3"}
        attributes = {
            "POSITION": gltf.add("accessors", dict(accessor)),
            "COLOR_0": gltf.add("accessors", accessor | {"componentType": 5121, "normalized": True}),
        }
        indices = gltf.add("accessors", {"componentType": 5125, "count": 30, "type": "SCALAR"})
        extension = {
            "bufferView": gltf.view(stream),
            "attributes": {"POSITION": position_id, "COLOR_0": unique_id},
        }
        primitive = {"attributes": attributes, "indices": indices}
        primitive["extensions"] = {"KHR_draco_mesh_compression": extension | changes}
        gltf.document["meshes"][0]["primitives"] = [primitive]
        gltf.document["extensionsUsed"] = gltf.document["extensionsRequired"] = ["KHR_draco_mesh_compression"]
        return gltf

    def test_geometry_and_attribute_ids(self, gltf):
        (mesh,) = read_scene(self.compressed(gltf).write("scene.glb")).meshes
        # Quantisation to 20 bits of an extent of 2.
        np.testing.assert_allclose(corners_of(mesh), self.POSITIONS[self.FACES], atol=2.1e-6)
        np.testing.assert_allclose(mesh.colors[mesh.triangles][..., 0], self.FACES / 255, atol=1e-6)
        np.testing.assert_allclose(mesh.colors[:, 1:], [[128 / 255, 1.0]] * 30, atol=1e-6)

    def test_a_missing_attribute_is_refused(self, gltf):
        with pytest.raises(InputError, match="COLOR_0: attribute 99 must be in the bitstream"):
            read_scene(self.compressed(gltf, attributes={"COLOR_0": 99}).write())

    def test_counts_that_differ_from_the_accessors_are_refused(self, gltf):
        self.compressed(gltf).document["accessors"][-1]["count"] = 27
        with pytest.raises(InputError, match="holds 30 indices, but its accessor says 27"):
            read_scene(gltf.write())

    def test_a_broken_bitstream_is_refused(self, gltf):
        self.compressed(gltf)
        gltf.document["bufferViews"][0]["byteLength"] //= 2
        with pytest.raises(InputError, match="Draco cannot decode it"):
            read_scene(gltf.write())
