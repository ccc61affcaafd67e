"""OBJ: all kinds of indices, polygons of any shape, materials, and rejected files."""

import numpy as np
import pytest
from PIL import Image

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def read_text(folder, text, name="scene.obj"):
    path = folder / name
    path.write_text(text)
    return read_scene(path)


def area(mesh):
    a, b, c = mesh.positions[mesh.triangles].astype(np.float64).transpose(1, 0, 2)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


def test_negative_indices_count_back_from_their_own_line(tmp_path):
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 5 5\nv 6 5 5\nv 5 6 5\nf -3 -2 -1\n"
    (mesh,) = read_text(tmp_path, text).meshes
    corners = mesh.positions[mesh.triangles]
    np.testing.assert_array_equal(corners[0], [[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    np.testing.assert_array_equal(corners[1], [[5, 5, 5], [6, 5, 5], [5, 6, 5]])


def test_forward_references_are_read(tmp_path):
    (mesh,) = read_text(tmp_path, "f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n").meshes
    assert area(mesh) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("outline", "expected"),
    [
        ([(0, 0), (2, 0), (2, 2), (0, 2)], 4.0),
        # An arrowhead from different first corners: one of its diagonals is outside.
        ([(0, 0), (2, 1), (0, 2), (1, 1)], 1.0),
        ([(2, 1), (0, 2), (1, 1), (0, 0)], 1.0),
        # An L, and a comb with two notches.
        ([(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)], 5.0),
        (
            [(0, 0), (5, 0), (5, 2), (4, 2), (4, 1), (3, 1), (3, 2), (2, 2), (2, 1), (1, 1), (1, 2), (0, 2)],
            8.0,
        ),
    ],
)
@pytest.mark.parametrize("plane", ["xy", "yz", "zx"])
@pytest.mark.parametrize("is_reversed", [False, True])
def test_polygons_are_covered_once_whatever_their_shape(tmp_path, outline, expected, plane, is_reversed):
    outline = outline[::-1] if is_reversed else outline
    axes = ["xyz".index(axis) for axis in plane]
    points = np.zeros((len(outline), 3))
    points[:, axes] = outline
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in points)
    (mesh,) = read_text(tmp_path, text + "f " + " ".join(map(str, range(1, len(outline) + 1)))).meshes
    a, b, c = mesh.positions[mesh.triangles].astype(np.float64).transpose(1, 0, 2)
    vectors = np.cross(b - a, c - a) / 2
    # If triangles overlapped or faced away, the sum of areas would exceed the area of the outline.
    assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(expected)
    assert np.linalg.norm(vectors.sum(axis=0)) == pytest.approx(expected)
    assert vectors[:, 3 - sum(axes)].min() * (-1 if is_reversed else 1) > 0 or is_reversed


def test_materials_textures_and_coordinates(tmp_path):
    texels = np.random.default_rng(6).integers(0, 256, (2, 3, 3), np.uint8)
    Image.fromarray(texels).save(tmp_path / "a map.png")
    (tmp_path / "lib one.mtl").write_text("newmtl red paint\nKd 0.5 0.25 0.125\nmap_Kd -clamp on a map.png\n")
    text = (
        "mtllib lib one.mtl\n"
        + SQUARE
        + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 2\n"
        + "usemtl red paint\nf 1/1/1 2/2/1 3/3/1 4/4/1\nusemtl red paint\n"
    )
    scene = read_text(tmp_path, text)
    (mesh,), (material,), (texture,) = scene.meshes, scene.materials, scene.textures
    assert material.name == "red paint"
    np.testing.assert_array_equal(material.base_color, [0.5, 0.25, 0.125])
    np.testing.assert_array_equal(texture.texels_srgb, texels)
    assert texture.wrap_u == "clamp_to_edge"
    np.testing.assert_array_equal(mesh.normals, [[0, 0, 1]] * 4)
    # v points up in OBJ, and down from the first row in a scene.
    by_position = {tuple(p): tuple(t) for p, t in zip(mesh.positions.tolist(), mesh.uv.tolist(), strict=True)}
    assert by_position[(0, 0, 0)] == (0, 1)
    assert by_position[(1, 1, 0)] == (1, 0)
    assert scene.warnings == ()


def test_a_metal_has_its_diffuse_part(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl a\nKd 0.8 0.4 0.2\nPm 0.75\n")
    scene = read_text(tmp_path, "mtllib a.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\n")
    np.testing.assert_allclose(scene.materials[0].base_color, [0.2, 0.1, 0.05], rtol=1e-6)
    assert scene.warnings == ("1 material is metallic; its diffuse part is drawn, its reflections are not",)


@pytest.mark.parametrize(
    ("statement", "opacity"), [("d 0.25", 0.25), ("Tr 0.75", 0.25), ("d -halo 0.5", 0.5)]
)
def test_a_dissolved_material_stops_its_share(tmp_path, statement, opacity):
    (tmp_path / "a.mtl").write_text(f"newmtl a\nKd 0.8 0.4 0.2\n{statement}\n")
    scene = read_text(tmp_path, "mtllib a.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\n")
    assert (scene.materials[0].alpha_mode, scene.materials[0].opacity) == ("blend", opacity)
    assert "1 material is see-through" in scene.warnings[0]


@pytest.mark.parametrize("has_color", [True, False])
def test_an_opacity_map_is_alpha_or_brightness(tmp_path, has_color):
    Image.fromarray(np.array([[0, 255], [51, 102]], np.uint8)).save(tmp_path / "hole map.png")
    Image.new("RGB", (1, 1), (9, 8, 7)).save(tmp_path / "c.png")
    color = "map_Kd c.png\n" if has_color else ""
    (tmp_path / "a.mtl").write_text(f"newmtl a\n{color}map_d hole map.png\n")
    scene = read_text(tmp_path, "mtllib a.mtl\n" + SQUARE + "vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n")
    (texture,) = scene.textures
    np.testing.assert_array_equal(texture.opacity, [[0, 255], [51, 102]])
    np.testing.assert_array_equal(texture.texels_srgb[0, 0], [9, 8, 7] if has_color else [255] * 3)
    assert texture.texels_srgb.shape == (2, 2, 3)
    assert scene.materials[0].is_blended


def test_missing_textures_and_libraries_are_said(tmp_path):
    (tmp_path / "a.mtl").write_text(
        "newmtl a\nmap_Kd no.png\nnewmtl b\nKd .5 .5 .5\nmap_Kd C:\\gone\\no.png\n"
    )
    text = "mtllib a.mtl none.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\nusemtl c\nf 1 2 4\n"
    scene = read_text(tmp_path, text)
    np.testing.assert_array_equal([m.base_color[0] for m in scene.materials], [1.0, 0.5, 1.0])
    assert scene.warnings == (
        "material library 'none.mtl' cannot be read; white is used",
        "1 material is not defined in any library; white is used",
        "2 textures missing ('no.png', …); Kd alone is used, or white without it",
    )


def test_a_broken_texture_is_refused(tmp_path):
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd broken.png\n")
    (tmp_path / "broken.png").write_bytes(b"\x89PNG\r\n\x1a\n????")
    with pytest.raises(InputError, match=r"scene\.obj: map_Kd 'broken\.png': image must be one of PNG"):
        read_text(tmp_path, "mtllib a.mtl\n" + SQUARE + "usemtl a\nf 1 2 3\n")


def test_vertex_colours_are_srgb(tmp_path):
    text = "v 0 0 0 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 0 1 0 1 1 1\nf 1 2 3\n"
    (mesh,) = read_text(tmp_path, text).meshes
    # 0.2140 is the linear value of sRGB 0.5.
    np.testing.assert_allclose(
        mesh.colors[mesh.triangles[0], 0], [0, ((0.5 + 0.055) / 1.055) ** 2.4, 1], atol=1e-6
    )


def test_corners_without_normals_are_flat_among_those_with(tmp_path):
    text = SQUARE + "vn 0 1 1\nf 1//1 2//1 3//1\nf 1 3 4\n"
    (mesh,) = read_text(tmp_path, text).meshes
    # 1e-7: the rounding to float32.
    np.testing.assert_allclose(
        mesh.normals[mesh.triangles[0]], [[0, np.sqrt(0.5), np.sqrt(0.5)]] * 3, atol=1e-7
    )
    np.testing.assert_allclose(mesh.normals[mesh.triangles[1]], [[0, 0, 1]] * 3, atol=1e-7)


def test_odd_but_clear_text_is_read(tmp_path):
    text = "\ufeff# comment\r\n\r\n  v 0 0 0\r\nv\t1 0 0 1.0\r\nv 0 1 \\\r\n0\r\ng\r\ns off\r\nf 1/ 2// 3\r\n"
    assert read_text(tmp_path, text.lstrip("\ufeff")).triangle_count() == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SQUARE + "f 1 2 5\n", "v index must be at most 4, got 5"),
        (
            SQUARE + "f 1 2 -5\n",
            "line 5: an index must be a whole number other than 0 and in range, got '-5'",
        ),
        (SQUARE + "f 0 1 2\n", "line 5: an index must be"),
        (SQUARE + "f 1 2 x\n", "line 5: an index must be"),
        (SQUARE + "f 1/1 2/1 3/1\n", "vt index must be at most 0, got 1"),
        (SQUARE + "f 1/1/1/1 2 3\n", "a corner must be written"),
        ("v 0 0\n" + SQUARE + "f 1 2 3\n", "v: must be 3 finite numbers, got '0 0'"),
        ("v 0 0 nan\n" + SQUARE + "f 1 2 3\n", "v: must be 3 finite numbers, got '0 0 nan'"),
        ("v 0 0 1e300\n" + SQUARE + "f 1 2 3\n", "v: must be 3 finite numbers"),
        (SQUARE, "has no triangles"),
        ("", "has no triangles"),
        ("v\0 0 0 0\n", "must be text"),
    ],
)
def test_broken_files_are_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=r"scene\.obj: .*" + message):
        read_text(tmp_path, text)


def test_what_is_no_surface_is_said(tmp_path):
    text = SQUARE + "f 1 2 3\nf 1 2\nl 1 2\np 1\ncurv 0 1 1 2\nnonsense\n"
    assert read_text(tmp_path, text).warnings == (
        "1 face of fewer than 3 corners is ignored",
        "2 point or line elements are ignored",
        "free-form curves and surfaces are ignored",
        "1 line with an unknown keyword is ignored",
    )
