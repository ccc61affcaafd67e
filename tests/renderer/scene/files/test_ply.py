"""PLY: ASCII and both byte orders, mixed polygons, colours, normals, textures, and rejected files."""

import struct

import numpy as np
import pytest
from PIL import Image

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene

POINTS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 0, 0)]
FACES = [(0, 1, 2, 3), (1, 4, 2)]
POSITION = "float x\nproperty float y\nproperty float z"
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


def write_ply(
    folder,
    format_name,
    vertices,
    faces,
    vertex_properties=POSITION,
    comment="",
):
    """Write a PLY with float and uchar vertex properties in the given order."""
    types = [line.split()[-2] for line in vertex_properties.split("\n")]
    header = (
        f"ply\nformat {format_name} 1.0\n{comment}"
        f"element vertex {len(vertices)}\nproperty {vertex_properties}\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    order = FORMATS[format_name]
    if order:
        layout = order + "".join({"float": "f", "uchar": "B"}[t] for t in types)
        body = b"".join(struct.pack(layout, *row) for row in vertices)
        body += b"".join(struct.pack(f"{order}B{len(face)}i", len(face), *face) for face in faces)
    else:
        rows = [*vertices, *((len(face), *face) for face in faces)]
        body = "".join(" ".join(map(str, row)) + "\n" for row in rows).encode()
    path = folder / "scene.ply"
    path.write_bytes(header.encode() + body)
    return path


@pytest.mark.parametrize("format_name", FORMATS)
@pytest.mark.parametrize("faces", [FACES, FACES[1:], FACES[:1] * 2])
def test_every_encoding_with_faces_alike_or_mixed(tmp_path, format_name, faces):
    (mesh,) = read_scene(write_ply(tmp_path, format_name, POINTS, faces)).meshes
    a, b, c = mesh.positions[mesh.triangles].transpose(1, 0, 2)
    # The square has area 1, the triangle 1/2; all face +z.
    expected = sum(1.0 if len(face) == 4 else 0.5 for face in faces)
    np.testing.assert_allclose(np.cross(b - a, c - a).sum(axis=0) / 2, [0, 0, expected], atol=1e-6)
    np.testing.assert_array_equal(mesh.normals, [[0, 0, 1]] * len(mesh.normals))


@pytest.mark.parametrize("format_name", FORMATS)
def test_normals_and_srgb_bytes(tmp_path, format_name):
    properties = "\nproperty ".join(
        [
            *(f"float {n}" for n in ("x", "y", "z", "nx", "ny", "nz")),
            *(f"uchar {n}" for n in ("red", "green", "blue")),
        ]
    )
    vertices = [(*point, 0, 3, 4, 0, 128, 255) for point in POINTS]
    (mesh,) = read_scene(write_ply(tmp_path, format_name, vertices, FACES, properties)).meshes
    assert len(mesh.positions) == 5
    np.testing.assert_allclose(mesh.normals, [[0, 0.6, 0.8]] * 5, atol=1e-7)
    # sRGB byte 128 is 0.2158605 linear, by IEC 61966-2-1.
    np.testing.assert_allclose(mesh.colors, [[0, 0.2158605, 1]] * 5, atol=1e-6)


def test_texture_and_coordinates(tmp_path):
    Image.new("RGB", (2, 2), (9, 8, 7)).save(tmp_path / "t.png")
    properties = "\nproperty ".join(f"float {n}" for n in ("x", "y", "z", "s", "t"))
    vertices = [(*point, point[0], point[1]) for point in POINTS]
    path = write_ply(tmp_path, "ascii", vertices, FACES, properties, "comment TextureFile t.png\n")
    scene = read_scene(path)
    assert scene.materials[0].texture == 0
    np.testing.assert_array_equal(scene.textures[0].texels_srgb, [[[9, 8, 7]] * 2] * 2)
    mesh = scene.meshes[0]
    np.testing.assert_allclose(mesh.uv, mesh.positions[:, :2] * [1, -1] + [0, 1])
    (tmp_path / "t.png").unlink()
    scene = read_scene(path)
    assert scene.materials[0].texture is None
    assert any("t.png" in warning for warning in scene.warnings)


@pytest.mark.parametrize("format_name", FORMATS)
def test_cut_off_data_are_refused(tmp_path, format_name):
    path = write_ply(tmp_path, format_name, POINTS, FACES)
    whole = path.read_bytes()
    start = whole.index(b"end_header") + 11
    for cut in range(start, len(whole) - 1):
        path.write_bytes(whole[:cut])
        with pytest.raises(InputError, match=r"cut off|must be numbers|fit the file"):
            read_scene(path)


@pytest.mark.parametrize("format_name", FORMATS)
def test_indices_out_of_range_are_refused(tmp_path, format_name):
    for wrong in (5, -1):
        with pytest.raises(InputError, match=f"vertex indices must be below 5, got {wrong}"):
            read_scene(write_ply(tmp_path, format_name, POINTS, [(0, 1, wrong)]))


def test_a_list_of_four_thousand_million_is_refused(tmp_path):
    path = tmp_path / "scene.ply"
    header = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty " + POSITION
    header += "\nelement face 1\nproperty list uint int vertex_indices\nend_header\n"
    path.write_bytes(header.encode() + bytes(12) + b"\xff\xff\xff\xff")
    with pytest.raises(InputError, match="a list's length must fit the file, got 4294967295"):
        read_scene(path)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ("plx\n", "must begin with 'ply'"),
        ("ply\nformat ascii 1.0\n", "end with 'end_header'"),
        ("ply\nelement vertex 1\nend_header\n", "must have a format line"),
        (
            "ply\nformat ascii 1.0\nproperty float x\nend_header\n",
            "line 'property float x' is not understood",
        ),
        (
            "ply\nformat ascii 1.0\nelement vertex -1\nend_header\n",
            "line 'element vertex -1' is not understood",
        ),
        (
            "ply\nformat ascii 1.0\nelement vertex 999999999999\nproperty float x\nend_header\n0\n",
            "rows are cut off",
        ),
        ("ply\nformat ascii 1.0\nend_header\n", "has no triangles"),
    ],
)
def test_broken_headers_are_refused(tmp_path, header, message):
    path = tmp_path / "scene.ply"
    path.write_text(header)
    with pytest.raises(InputError, match=r"scene\.ply: .*" + message):
        read_scene(path)


def test_not_a_number_is_refused(tmp_path):
    with pytest.raises(InputError, match="x, y, z must be finite"):
        read_scene(write_ply(tmp_path, "ascii", [(0, 0, "nan"), *POINTS], FACES))


def test_a_comment_may_name_the_end(tmp_path):
    path = tmp_path / "triangle.ply"
    path.write_text(
        "ply\nformat ascii 1.0\ncomment without end_header here\nelement vertex 3\n"
        "property float x\nproperty float y\nproperty float z\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    assert read_scene(path).triangle_count() == 1
