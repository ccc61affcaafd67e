"""OBJ, MTL and PLY text that misleads or stalls a reader: each is read right, or refused with one line."""

import math

import numpy as np
import pytest
from PIL import Image
from reading_cost import check_cost

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.files.limits import MAX_INSTANCES
from vpltune.renderer.scene.files.mtl_materials import MOST_LIBRARIES

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
MARK = b"\xef\xbb\xbf"
PLY = b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
PLY += b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"


def read_bytes(folder, content, name="scene.obj"):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_scene(path)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_a_byte_order_mark_and_any_line_end_leave_the_vertices_as_they_are(tmp_path, end):
    text = "v 1 0 0\nv 2 0 0\nv 1 1 0\nv 9 9 9\nf 1 2 3\n".replace("\n", end)
    (mesh,) = read_bytes(tmp_path, MARK + text.encode()).meshes
    np.testing.assert_array_equal(mesh.positions[mesh.triangles[0]], [[1, 0, 0], [2, 0, 0], [1, 1, 0]])


def test_a_stray_carriage_return_ends_a_line(tmp_path):
    (mesh,) = read_bytes(tmp_path, "v 0 0 0\rv 1 0 0\nv 0 1 0\nf 1 2 3\n").meshes
    np.testing.assert_array_equal(mesh.positions[mesh.triangles[0]], [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    assert mesh.colors.min() == 1.0


def test_a_byte_order_mark_before_a_material_library_or_a_ply_file(tmp_path):
    (tmp_path / "a.mtl").write_bytes(MARK + b"newmtl a\nKd 0.5 0.5 0.5\n")
    scene = read_bytes(tmp_path, "mtllib a.mtl\nusemtl a\n" + TRIANGLE + "f 1 2 3\n")
    assert scene.materials[0].base_color[0] == 0.5
    body = b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    assert read_bytes(tmp_path, MARK + PLY + body, "a.ply").triangle_count() == 1


def test_a_ply_property_that_is_not_read_may_be_nan(tmp_path):
    """Scans have it where they know no quality. In a property that is read, it is refused."""
    header = PLY.decode().replace("float z\n", "float z\nproperty float quality\n")
    body = "0 0 0 nan\n1 0 0 nan\n0 1 0 0\n3 0 1 2\n"
    assert read_bytes(tmp_path, header + body, "a.ply").triangle_count() == 1
    with pytest.raises(InputError, match="x, y, z must be finite"):
        read_bytes(tmp_path, header + body.replace("0 0 0 nan", "nan 0 0 0"), "a.ply")


def test_a_material_library_in_utf16_is_refused(tmp_path):
    (tmp_path / "a.mtl").write_bytes("newmtl a\nKd 0.5 0.5 0.5\n".encode("utf-16"))
    with pytest.raises(InputError, match=r"'a\.mtl': must be text in UTF-8"):
        read_bytes(tmp_path, "mtllib a.mtl\nusemtl a\n" + TRIANGLE + "f 1 2 3\n")


@pytest.mark.parametrize(
    "index", ["0_3", "٣", "3.0", "99999999999999999999", "3" * 5000, "+-3", "1e0", "0x3"]
)
def test_an_index_is_ascii_digits_that_fit_32_bits(tmp_path, index):
    with pytest.raises(InputError, match="line 4: an index must be a whole number other than 0 and in range"):
        read_bytes(tmp_path, f"{TRIANGLE}f 1 2 {index}\n")


@pytest.mark.parametrize("number", ["1_0", "١", "infinity", "nan", "1e31", "0x1", "1,5"])
def test_a_number_is_ascii_digits_and_finite(tmp_path, number):
    with pytest.raises(InputError, match="line 1: v: must be 3 finite numbers"):
        read_bytes(tmp_path, f"v 0 0 {number}\n{TRIANGLE}f 1 2 3\n")
    (tmp_path / "a.mtl").write_text(f"newmtl a\nKd 1 1 {number}\n")
    with pytest.raises(InputError, match=r"'a\.mtl' line 2: a colour must be 3 finite numbers"):
        read_bytes(tmp_path, "mtllib a.mtl\nusemtl a\n" + TRIANGLE + "f 1 2 3\n")
    with pytest.raises(InputError, match="must be finite|must be numbers"):
        read_bytes(tmp_path, PLY + f"0 0 {number}\n1 0 0\n0 1 0\n3 0 1 2\n".encode(), "a.ply")


def test_comments_after_numbers_are_no_colours(tmp_path):
    (mesh,) = read_bytes(tmp_path, "v 0 0 0 # 0 0 0\n" + TRIANGLE + "f 1 3 4 # 2\n").meshes
    assert mesh.colors.min() == 1.0
    assert len(mesh.triangles) == 1


@pytest.mark.parametrize("line", ["d 0.1", "Tr 0.9", "d -halo 0.5"])
def test_a_see_through_material_is_said(tmp_path, line):
    (tmp_path / "a.mtl").write_text(f"newmtl a\nKd .5 .5 .5\n{line}\nnewmtl unused\nd 0.1\n")
    scene = read_bytes(tmp_path, "mtllib a.mtl\nusemtl a\n" + TRIANGLE + "f 1 2 3\n")
    assert scene.warnings == (
        "1 material is see-through: light passes by its share, the camera sees it if half opaque or more",
    )


@pytest.mark.parametrize("lines", ["d 1.0", "Tr 0", "d 1\nTr 1", "Tr 1\nd 1", "d odd", "d nan", "Tr nan"])
def test_an_opaque_material_is_not(tmp_path, lines):
    """Some programs write Tr 1 for opaque, beside d 1."""
    (tmp_path / "a.mtl").write_text(f"newmtl a\nKd .5 .5 .5\n{lines}\n")
    assert read_bytes(tmp_path, "mtllib a.mtl\nusemtl a\n" + TRIANGLE + "f 1 2 3\n").warnings == ()


def test_a_black_kd_under_a_map_is_said(tmp_path):
    Image.new("RGB", (2, 2), (200, 200, 200)).save(tmp_path / "g.png")
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 0 0 0\nmap_Kd g.png\n")
    scene = read_bytes(tmp_path, "mtllib a.mtl\nusemtl a\n" + TRIANGLE + "f 1 2 3\n")
    assert not scene.materials[0].base_color.any()
    assert "1 material is black: its Kd 0 0 0 multiplies its map_Kd" in scene.warnings


def stars(faces, corners):
    """Star polygons, each in a plane of its own and of another size, so that none are alike."""
    lines, first = [], 1
    for face in range(faces):
        count = corners - 2 * face
        for i in range(count):
            angle, radius = 2.0 * math.pi * i / count, 0.5 + 0.5 * (i % 2)
            lines.append(f"v {radius * math.cos(angle):.4f} {radius * math.sin(angle):.4f} {face}")
        lines.append("f " + " ".join(map(str, range(first, first + count))))
        first += count
    return "\n".join(lines)


def test_stars_of_many_corners_are_covered_once(tmp_path):
    (mesh,) = read_bytes(tmp_path, stars(5, 200)).meshes
    a, b, c = mesh.positions[mesh.triangles].astype(np.float64).transpose(1, 0, 2)
    vectors = np.cross(b - a, c - a) / 2.0
    # A star of n corners on radii 1/2 and 1 is n triangles of area sin(2π/n) / 4. 1e-3: four decimals.
    expected = sum(0.25 * n * math.sin(2.0 * math.pi / n) for n in range(200, 190, -2))
    assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(expected, rel=1e-3)
    assert vectors[:, 2].sum() == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    "text",
    [
        TRIANGLE + "".join(f"usemtl m{i}\nf 1 2 3\n" for i in range(100_000)),
        TRIANGLE + "".join(f"usemtl m{i}\nf 1/1 2/1 3/1\n" for i in range(10_000)) + "vt 0 0\n" * 200_000,
        "mtllib a b c d e f g h\n" * 200_000 + TRIANGLE + "f 1 2 3\n",
        "".join(f"mtllib a{i}\n" for i in range(200_000)) + TRIANGLE + "f 1 2 3\n",
        "v \\\n" + "\\\n" * 3_000_000,
        "f" + " 1" * 30_000_000,
        stars(50, 2000),
        TRIANGLE + ("f" + " 1 2 3" * 600 + "\n") * 500,
        # As many as the limits allow: the time for each corner is that of the fans above, the memory is not.
        pytest.param(TRIANGLE + ("f" + " 1 2 3" * 600 + "\n") * 2_900, marks=pytest.mark.slow),
    ],
    ids=[
        *("materials", "uvs", "libraries", "other libraries", "continued", "one line", "stars", "fans"),
        "most fans",
    ],
)
def test_reading_costs_little(tmp_path, text):
    path = tmp_path / "scene.obj"
    path.write_text(text)
    check_cost(path)


def test_a_library_of_very_many_materials_is_refused(tmp_path):
    (tmp_path / "scene.mtl").write_text("".join(f"newmtl {i}\nKd 1 1 1\n" for i in range(1_000_000)))
    (tmp_path / "scene.obj").write_text("mtllib scene.mtl\n" + TRIANGLE + "f 1 2 3\n")
    assert "'scene.mtl': must define at most 100,000 materials" in check_cost(tmp_path / "scene.obj")


def test_more_materials_than_draw_calls_are_refused(tmp_path):
    text = TRIANGLE + "".join(f"usemtl m{i}\nf 1 2 3\n" for i in range(MAX_INSTANCES + 1))
    with pytest.raises(InputError, match="faces must use at most 10,000 materials, got more"):
        read_bytes(tmp_path, text)


def test_more_libraries_than_are_looked_for_are_refused(tmp_path):
    text = "mtllib " + " ".join(map(str, range(MOST_LIBRARIES + 1))) + "\n" + TRIANGLE + "f 1 2 3\n"
    with pytest.raises(InputError, match="mtllib: must name at most 1,000 libraries, got more"):
        read_bytes(tmp_path, text)


@pytest.mark.parametrize(
    ("word", "count"),
    [
        ("1 ", 2_100_000),
        ("0.123456 ", 2_100_000),
        # The memory of the most words that the limits allow.
        pytest.param("1 ", 21_000_000, marks=pytest.mark.slow),
    ],
)
def test_reading_ascii_ply_costs_little(tmp_path, word, count):
    header = PLY.decode().replace("vertex 3", f"vertex {count // 3}")
    (tmp_path / "scene.ply").write_text(header + word * count + "\n3 0 1 2\n")
    assert "the scene has no triangles" in check_cost(tmp_path / "scene.ply")


def test_numbers_across_borders_stay_whole(tmp_path):
    count = 300_000
    vertices = np.random.default_rng(0).random((count, 3)).round(6)
    text = "\n".join(f"{x} {y} {z}" for x, y, z in vertices.tolist())
    faces = "\n".join(f"3 {i} {i + 1} {i + 2}" for i in range(0, count, 3))
    header = PLY.decode().replace("vertex 3", f"vertex {count}").replace("face 1", f"face {count // 3}")
    (mesh,) = read_bytes(tmp_path, header + text + "\n" + faces + "\n", "a.ply").meshes
    np.testing.assert_array_equal(mesh.positions[mesh.triangles.ravel()], vertices.astype(np.float32))


QUAD = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def test_a_comment_is_not_continued(tmp_path):
    """`# C:\\scenes\\` is a path, and the vertex below it a vertex."""
    path = tmp_path / "quad.obj"
    path.write_text("# C:\\scenes\\\n" + QUAD + "v 9 9 9\nf 1 2 3 4\n")
    (mesh,) = read_scene(path).meshes
    np.testing.assert_array_equal(mesh.positions.max(axis=0), [1.0, 1.0, 0.0])


def test_names_keep_their_number_signs_and_lose_remarks(tmp_path):
    (tmp_path / "m #1.mtl").write_text("newmtl Material #25 # bricks\nKd 0.2 0.4 0.6 #grey\n")
    path = tmp_path / "quad.obj"
    path.write_text(f"mtllib m #1.mtl # here\n{QUAD}usemtl Material #25 # walls\nf 1 2 3 4\n")
    scene = read_scene(path)
    np.testing.assert_allclose(
        scene.materials[scene.meshes[0].material].base_color, [0.2, 0.4, 0.6], atol=1e-6
    )
    assert not scene.warnings
