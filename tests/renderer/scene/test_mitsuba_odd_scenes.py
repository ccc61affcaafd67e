"""Mitsuba scenes large for their size, or with one odd part: the rest comes over, with a word."""

import math
import time
from dataclasses import replace

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from reading_cost import MITSUBA, check_cost

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.scene.files.limits import MAX_INSTANCES, MAX_PLACED_VERTICES
from vpltune.renderer.scene.mitsuba_import import read_mitsuba
from vpltune.renderer.scene.scene import Instance, Mesh, Scene
from vpltune.renderer.scene.transforms import transform_points

CUBE = '<shape type="cube"/>'
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
LINE = "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"
RAW = '<boolean name="raw" value="true"/>'
FLAT = '<boolean name="face_normals" value="true"/>'
OBJ = '<shape type="obj"><string name="filename" value="{}"/></shape>'


def read(folder, body):
    path = folder / "scene.xml"
    path.write_text(f'<scene version="3.0.0">{body}</scene>')
    return read_mitsuba(path)


def nested_defaults(times, levels):
    defaults = f'<default name="a0" value="{"x" * 100}"/>'
    for level in range(1, levels):
        defaults += f'<default name="a{level}" value="{f"$a{level - 1} " * times}"/>'
    return f'<scene>{defaults}<shape type="cube"><string name="z" value="$a{levels - 1}"/></shape></scene>'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (nested_defaults(20, 8), "must have at most 65,536 characters"),
        # Each value is short enough, and there are many.
        (
            '<scene><default name="a" value="' + "x" * 60_000 + '"/>'
            '<shape type="cube">' + '<string name="z" value="$a"/>' * 100_000 + "</shape></scene>",
            "and all together 16,777,216",
        ),
        ("<scene>" + CUBE * (MAX_INSTANCES + 1) + "</scene>", "a scene must have at most 10,000 shapes"),
        (
            f'<scene><shape type="shapegroup" id="g">{CUBE * 200}</shape>'
            + '<shape type="instance"><ref id="g"/></shape>' * 200
            + "</scene>",
            "must place at most 10,000 shapes",
        ),
        ("<scene>" + "<a/>" * 600_000, "must have at most 500,000 elements"),
        ("<scene>" + '<string name="b" value="c"/>' * 499_000 + "</scene>", "has no triangles"),
        ('<scene><path value="."/>' + '<path value="."/>' * 32 + "</scene>", "at most 32 search paths"),
    ],
    ids=["nested", "many", "shapes", "instances", "elements", "values", "paths"],
)
def test_a_small_file_costs_little(tmp_path, text, message):
    path = tmp_path / "scene.xml"
    path.write_text(text)
    assert message in check_cost(path, MITSUBA)


SHARED = {
    "spheres": '<shape type="sphere"/>',
    "flat spheres": '<shape type="sphere"><boolean name="face_normals" value="true"/></shape>',
    "emitters": '<shape type="sphere"><emitter type="area"/></shape>',
    "disks": '<shape type="disk"><emitter type="area"/></shape>',
    "a file": OBJ.format("grid.obj"),
    "a large map": '<shape type="cube"><bsdf type="diffuse"><texture type="bitmap" name="reflectance">'
    '<string name="filename" value="map.png"/></texture></bsdf></shape>',
}


@pytest.mark.parametrize("shape", SHARED.values(), ids=SHARED)
def test_shapes_that_have_their_triangles_in_common_share_the_work(tmp_path, shape):
    """5,000 spheres would take 8 s with triangles of their own, and so many readings of a file a minute."""
    (tmp_path / "grid.obj").write_text(grid_obj(60))
    Image.new("RGB", (2048, 2048)).save(tmp_path / "map.png")
    path = tmp_path / "scene.xml"
    path.write_text(f"<scene>{shape * 5_000}{CUBE}</scene>")
    assert check_cost(path, MITSUBA) == ""


def grid_obj(side):
    """Squares, side × side of them."""
    lines = [f"v {x} {y} 0" for y in range(side + 1) for x in range(side + 1)]
    first = [y * (side + 1) + x + 1 for y in range(side) for x in range(side)]
    lines += [f"f {i} {i + 1} {i + side + 2} {i + side + 1}" for i in first]
    return "\n".join(lines)


def test_instances_that_place_many_vertices_are_refused_by_their_count(tmp_path):
    """Each has a vertex for every corner of a triangle, since the grid is shaded flat."""
    (tmp_path / "grid.obj").write_text(grid_obj(60))
    body = f'<shape type="shapegroup" id="g">{OBJ.format("grid.obj").replace("</shape>", FLAT + "</shape>")}'
    body += "</shape>" + '<shape type="instance"><ref id="g"/></shape>' * 9_000
    path = tmp_path / "scene.xml"
    path.write_text(f"<scene>{body}</scene>")
    # 60² squares of two triangles, three corners each.
    placed = 9_000 * 60**2 * 6
    said = f"its instances must place at most {MAX_PLACED_VERTICES:,} vertices together, got {placed:,}"
    assert said in check_cost(path, MITSUBA)


def test_shapes_share_a_mesh_where_material_and_triangles_are_the_same(tmp_path):
    red = '<bsdf type="diffuse" id="red"><rgb name="reflectance" value="1 0 0"/></bsdf>'
    use = '<shape type="sphere"><float name="radius" value="{}"/>{}</shape>'
    body = red + use.format(1, "") + use.format(2, "") + use.format(3, '<ref id="red"/>') + CUBE
    scene = read(tmp_path, body)
    assert [instance.mesh for instance in scene.instances] == [0, 0, 1, 2]
    assert [mesh.material for mesh in scene.meshes] == [0, 1, 0]
    assert scene.meshes[1].positions is scene.meshes[0].positions
    assert scene.bounds()[1] == pytest.approx([3.0] * 3, rel=1e-6)  # the sphere's poles and equator


def test_bounds_are_those_of_all_placed_vertices():
    """More vertices and instances than are bounded at a time."""
    rng = np.random.default_rng(3)
    points = rng.normal(size=(40_000, 3)).astype(np.float32)
    mesh = Mesh(
        "cloud",
        points,
        np.zeros_like(points),
        np.zeros((len(points), 2), np.float32),
        np.ones_like(points),
        np.array([[0, 1, 2]], np.int32),
        0,
    )
    few = replace(mesh, positions=points[:3], normals=points[:3], uv=mesh.uv[:3], colors=points[:3])
    matrices = np.tile(np.eye(4), (20_003, 1, 1))
    matrices[:, :3] = rng.normal(size=(20_003, 3, 4))
    instances = [Instance("", int(i >= 3), matrix) for i, matrix in enumerate(matrices)]
    scene = Scene("clouds", (mesh, few), tuple(instances), ())
    placed = np.concatenate(
        [transform_points(matrix, points if i < 3 else points[:3]) for i, matrix in enumerate(matrices)]
    )
    # Sums of three products in another order: 1e-14 of lengths of 10.
    np.testing.assert_allclose(scene.bounds(), [placed.min(axis=0), placed.max(axis=0)], atol=1e-13)


def test_a_default_is_put_in_once_and_whole(tmp_path):
    """$wide is not $w followed by ide."""
    scene = read(
        tmp_path,
        '<default name="w" value="1"/><default name="wide" value="2"/>'
        '<shape type="sphere"><float name="radius" value="$wide"/></shape>',
    )
    assert scene.bounds()[1][0] == pytest.approx(2.0, rel=1e-3)  # a polygon of 80 sides


@pytest.mark.parametrize("row", ["5 6 7 0", "0 0 0 2", "0 0 1 1", "0 0 0 1_0"])
def test_a_matrix_must_be_affine(tmp_path, row):
    matrix = f'<transform name="to_world"><matrix value="1 0 0 0 0 1 0 0 0 0 1 0 {row}"/></transform>'
    with pytest.raises(InputError, match="the last row must be 0 0 0 1|must be 16 finite numbers"):
        read(tmp_path, f'<shape type="cube">{matrix}</shape>')


def test_files_are_looked_for_in_search_paths_from_the_last_to_the_first(tmp_path):
    for folder, height in (("one", 1), ("two", 2), (".", 3)):
        (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / folder / "a.obj").write_text(TRIANGLE.replace("v 0 1 0", f"v 0 {height} 0"))
    (tmp_path / "b.obj").write_text(TRIANGLE)
    paths = '<path value="one"/><default name="last" value="two"/><path value="$last"/>'
    scene = read(tmp_path, OBJ.format("a.obj") + paths + OBJ.format("b.obj"))
    assert scene.meshes[0].positions[:, 1].max() == 2.0
    assert len(scene.meshes) == 2


def test_search_paths_that_lead_nowhere_or_out_are_said(tmp_path):
    inside = tmp_path / "in"
    inside.mkdir()
    (tmp_path / "secret.obj").write_text(TRIANGLE)
    scene = read(inside, '<path value=".."/><path value="none"/>' + CUBE)
    assert scene.warnings[:2] == (
        "search path '..' is not inside the scene's folder; it is passed over",
        "search path 'none' is not a folder; it is passed over",
    )
    with pytest.raises(InputError, match=r"'secret\.obj' does not exist"):
        read(inside, '<path value=".."/>' + OBJ.format("secret.obj"))


def test_a_path_belongs_to_the_scene(tmp_path):
    with pytest.raises(InputError, match="<path>"):
        read(tmp_path, '<shape type="cube"><path value="."/></shape>')


def test_meshes_without_area_are_left_out_together(tmp_path):
    (tmp_path / "line.obj").write_text(LINE)
    scene = read(tmp_path, CUBE + OBJ.format("line.obj") * 20)
    assert len(scene.instances) == 1
    assert "20 shapes have no triangle with area; they are left out" in scene.warnings


GLOWING = '<shape type="rectangle"><emitter type="area">{}</emitter></shape>'
GLOWING = GLOWING.format('<texture type="{}" name="radiance">{}</texture>')


def glowing_material(scene):
    (material,) = (scene.materials[mesh.material] for mesh in scene.meshes)
    return material


def test_a_bitmap_of_radiance_is_an_emission_texture(tmp_path):
    texels = np.random.default_rng(1).integers(0, 256, (4, 4, 3)).astype(np.uint8)
    Image.fromarray(texels).save(tmp_path / "map.png")
    inner = '<string name="filename" value="map.png"/><transform name="to_uv"><scale x="3"/></transform>'
    scaled = f'<texture type="bitmap">{inner}</texture><float name="scale" value="10"/>'
    scene = read(tmp_path, GLOWING.format("scale", scaled))
    material = glowing_material(scene)
    assert material.emission == (10.0, 10.0, 10.0)
    np.testing.assert_array_equal(scene.textures[material.emission_texture].texels_srgb, texels)
    assert scene.meshes[0].uv[:, 0].max() == 3.0
    assert scene.warnings == ()


@pytest.mark.parametrize("darkest", [1.0, 1e-6])
def test_a_bright_bitmap_becomes_a_factor_and_a_texture(tmp_path, darkest):
    pixels = np.full((2, 2, 3), darkest, np.float32)
    pixels[0] = (12.0, 6.0, 0.0)
    OpenEXR.File({}, {"RGB": pixels}).write(str(tmp_path / "map.exr"))
    scene = read(tmp_path, GLOWING.format("bitmap", '<string name="filename" value="map.exr"/>'))
    material = glowing_material(scene)
    np.testing.assert_allclose(material.emission, (12.0, 6.0, darkest), rtol=1e-6)
    linear = linear_from_srgb(scene.textures[material.emission_texture].texels_srgb / 255.0)
    # Half a step of eight bits, at most 0.5 % of the largest value.
    np.testing.assert_allclose(linear * material.emission, pixels, atol=0.06)
    assert any("spans more than eight bits hold" in line for line in scene.warnings) == (darkest < 1e-3)


def test_other_textures_of_radiance_count_by_their_mean_with_a_word(tmp_path):
    inner = '<rgb name="color0" value="8 0 2"/><rgb name="color1" value="2 4 0"/>'
    scene = read(tmp_path, GLOWING.format("checkerboard", inner))
    material = glowing_material(scene)
    assert (material.emission, material.emission_texture) == ((5.0, 2.0, 1.0), None)
    (said,) = scene.warnings
    assert "its mean, 5, 2, 1 " in said
    assert "checkerboard" in said


def test_textures_of_radiance_and_colour_that_lie_otherwise(tmp_path):
    """A mesh has one set of texture coordinates."""
    Image.new("RGB", (2, 2)).save(tmp_path / "map.png")
    bitmap = '<texture type="bitmap" name="{}"><string name="filename" value="map.png"/>{}</texture>'
    moved = '<transform name="to_uv"><scale x="3"/></transform>'
    bsdf = f'<bsdf type="diffuse">{bitmap.format("reflectance", moved)}</bsdf>'
    shape = '<shape type="rectangle">{}<emitter type="area">{}</emitter></shape>'
    scene = read(tmp_path, shape.format(bsdf, bitmap.format("radiance", "")))
    material = glowing_material(scene)
    assert material.texture is None
    assert material.emission_texture is not None
    assert any("which is dropped" in line for line in scene.warnings)
    alike = glowing_material(read(tmp_path, shape.format(bsdf, bitmap.format("radiance", moved))))
    assert alike.texture == alike.emission_texture


def test_a_scaled_radiance_is_scaled(tmp_path):
    inner = '<texture type="checkerboard"/><float name="scale" value="10"/>'
    material = glowing_material(read(tmp_path, GLOWING.format("scale", inner)))
    np.testing.assert_allclose(material.emission, 3.0, rtol=1e-12)  # the mean of 0.4 and 0.2


def test_a_second_environment_is_left_out(tmp_path):
    two = '<emitter type="constant"/><emitter type="constant"><rgb name="radiance" value="5"/></emitter>'
    scene = read(tmp_path, CUBE + two)
    np.testing.assert_array_equal(scene.environment.radiance, 1.0)
    assert any("a scene has one environment" in line for line in scene.warnings)


def test_an_absent_environment_is_said(tmp_path):
    scene = read(
        tmp_path, CUBE + '<emitter type="envmap"><string name="filename" value="gone.exr"/></emitter>'
    )
    assert scene.warnings[0].startswith("the environment 'gone.exr' is ignored: ")


@pytest.mark.parametrize(
    ("beam", "cutoff", "degrees", "said"),
    [
        (30, 30, 30.0, "1 spot has a hard edge"),
        (100, 120, 90.0, "1 spot shines wider than 90° from its axis; it ends there"),
        (60, 120, 90.0, "1 spot shines wider than 90° from its axis; it ends there"),
    ],
)
def test_hard_and_wide_spots_come_over_with_a_word(tmp_path, beam, cutoff, degrees, said):
    spot = f'<emitter type="spot"><float name="beam_width" value="{beam}"/>'
    spot += f'<float name="cutoff_angle" value="{cutoff}"/></emitter>'
    scene = read(tmp_path, CUBE + spot)
    (light,) = scene.lights
    assert light.outer_cone == pytest.approx(math.radians(degrees))
    # A thousandth of the half angle is left of a hard edge, for the renderer to divide by.
    expected = min(beam, 0.999 * degrees)
    assert light.inner_cone == pytest.approx(math.radians(expected), rel=1e-6)
    assert said in scene.warnings


def test_a_beam_wider_than_its_cutoff_is_refused(tmp_path):
    spot = '<emitter type="spot"><float name="beam_width" value="40"/></emitter>'
    with pytest.raises(InputError, match=r"beam_width ≤ cutoff_angle ≤ 180 degrees .*, got 40 and 20"):
        read(tmp_path, CUBE + spot)


@pytest.mark.parametrize("metallic", [0.0, 0.75])
def test_a_metallic_material_has_its_diffuse_part(tmp_path, metallic):
    bsdf = f'''<bsdf type="principled"><rgb name="base_color" value="0.8 0.4 0.2"/>
      <float name="metallic" value="{metallic}"/></bsdf>'''
    scene = read(tmp_path, f'<shape type="cube">{bsdf}</shape>')
    said = "1 material is metallic; its diffuse part is drawn, its reflections are not"
    assert (said in scene.warnings) is (metallic > 0.0)
    np.testing.assert_allclose(
        scene.materials[0].base_color, (1.0 - metallic) * np.array([0.8, 0.4, 0.2]), rtol=1e-6
    )


def test_a_mask_stops_its_share(tmp_path):
    inner = '<bsdf type="diffuse"><rgb name="reflectance" value="0.25"/></bsdf>'
    bsdf = f'<bsdf type="mask"><float name="opacity" value="0.75"/>{inner}</bsdf>'
    scene = read(tmp_path, f'<shape type="cube">{bsdf}</shape>')
    material = scene.materials[scene.meshes[0].material]
    assert (material.alpha_mode, material.opacity) == ("blend", 0.75)
    np.testing.assert_array_equal(material.base_color, 0.25)


def test_a_mask_may_be_an_image(tmp_path):
    Image.fromarray(np.array([[0, 51, 255]], np.uint8)).save(tmp_path / "m.png")
    image = """<texture name="opacity" type="bitmap"><string name="filename" value="m.png"/>
      <boolean name="raw" value="true"/></texture>"""
    bsdf = f'<bsdf type="mask">{image}<bsdf type="diffuse"/></bsdf>'
    scene = read(tmp_path, f'<shape type="cube">{bsdf}</shape>')
    material = scene.materials[scene.meshes[0].material]
    np.testing.assert_array_equal(scene.textures[material.texture].opacity, [[0, 51, 255]])
    assert (material.alpha_mode, material.opacity) == ("blend", 1.0)


def test_a_conductor_reflects_no_diffuse_light(tmp_path):
    scene = read(tmp_path, '<shape type="cube"><bsdf type="roughconductor"/></shape>')
    assert "1 metal is drawn black: its reflections are not drawn" in scene.warnings
    np.testing.assert_array_equal(scene.materials[0].base_color, 0.0)


def test_why_no_triangle_is_left_is_said(tmp_path):
    glass = '<shape type="cube"><bsdf type="dielectric"/></shape>'
    with pytest.raises(
        InputError, match=r"has no triangles \(1 material is glass or empty: its surfaces are"
    ):
        read(tmp_path, glass)


AREA = '<shape type="rectangle"><emitter type="area"><rgb name="radiance" value="{}"/></emitter></shape>'
CONSTANT = '<emitter type="constant"><rgb name="radiance" value="{}"/></emitter>'


@pytest.mark.parametrize(
    ("emitter", "said"),
    [
        (
            '<emitter type="point"><rgb name="intensity" value="6e19"/></emitter>',
            r"intensity must be at most 1e\+18 W/sr .*, got 6e\+19",
        ),
        (AREA.format("1e19"), r"emitter 'area': radiance must be from 0 to 1e\+18"),
        (AREA.format("-1"), "must not be negative"),
        (AREA.format("nan"), "must be 1 finite number"),
        (CONSTANT.format("1e19"), r"emitter 'constant': radiance must be from 0 to 1e\+18"),
    ],
)
def test_a_light_that_no_scene_file_may_hold_is_refused(tmp_path, emitter, said):
    """A .glb of it could not be read again."""
    with pytest.raises(InputError, match=said):
        read(tmp_path, CUBE + emitter)


def test_references_nested_too_deep_are_refused_in_bounded_time(tmp_path):
    chain = '<bsdf type="diffuse" id="m0"/>'
    chain += "".join(f'<bsdf type="twosided" id="m{i + 1}"><ref id="m{i}"/></bsdf>' for i in range(5_000))
    start = time.process_time()
    with pytest.raises(InputError, match="references are nested too deep"):
        read(tmp_path, chain + '<shape type="cube"><ref id="m5000"/></shape>')
    # Generous: checked annotations take most of it.
    assert time.process_time() - start < 20.0
