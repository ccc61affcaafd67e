"""Import of the light of Mitsuba scenes, compared with what Mitsuba itself computes."""

import math

import mitsuba as mi
import numpy as np
import pytest
from mitsuba_files import AREA_LIGHT, scene_file

from vpltune.renderer.scene.environment import Environment, solid_angles, texel_directions
from vpltune.renderer.scene.mitsuba_import import read_mitsuba
from vpltune.renderer.scene.transforms import transform_normals, transform_points


def test_punctual_lights_come_over_as_they_are(tmp_path):
    more = """
      <emitter type="point"><point name="position" x="1" y="2" z="3"/>
        <rgb name="intensity" value="4 5 6"/></emitter>
      <emitter type="spot">
        <transform name="to_world"><lookat origin="0 3 0" target="0 0 0" up="1 0 0"/></transform>
        <rgb name="intensity" value="90"/><float name="cutoff_angle" value="40"/></emitter>
      <emitter type="directional"><vector name="direction" x="1" y="-1" z="0"/>
        <rgb name="irradiance" value="#ffffff"/></emitter>"""
    point, spot, sun = read_mitsuba(scene_file(tmp_path, more=more)).lights
    assert point.position_world.tolist() == [1.0, 2.0, 3.0] and point.intensity.tolist() == [4.0, 5.0, 6.0]
    np.testing.assert_allclose(spot.direction_world, (0.0, -1.0, 0.0), atol=1e-12)
    assert (spot.inner_cone, spot.outer_cone) == pytest.approx((math.radians(30.0), math.radians(40.0)))
    np.testing.assert_allclose(sun.direction_world, (math.sqrt(0.5), -math.sqrt(0.5), 0.0))
    np.testing.assert_allclose(sun.intensity, 1.0)


@pytest.mark.parametrize(
    "turn",
    [
        '<rotate y="1" angle="37"/>',
        '<rotate x="1" angle="90"/><rotate z="1" angle="20"/>',
        '<rotate x="0.36" y="0.48" z="-0.8" angle="200"/>',
    ],
    ids=["y", "upright", "any"],
)
def test_an_environment_is_turned_as_mitsuba_turns_it(tmp_path, turn):
    sky = np.full((64, 128, 3), 0.1, np.float32)
    sky[20:23, 40:43] = 500.0, 400.0, 300.0
    mi.set_variant("scalar_rgb")
    mi.Bitmap(sky).write(str(tmp_path / "sky.exr"))
    more = f"""<emitter type="envmap"><string name="filename" value="sky.exr"/>
      <float name="scale" value="2"/><transform name="to_world">{turn}</transform></emitter>"""
    path = scene_file(tmp_path, more=more)
    scene = read_mitsuba(path)
    assert scene.environment is not None and not scene.lights
    height, width, _ = scene.environment.radiance.shape
    weights = (scene.environment.radiance[..., 0] > 100.0) * solid_angles(height, width)[:, None]
    towards = np.einsum("hw,hwd->d", weights, texel_directions(height, width))
    # Mitsuba itself has the middle of the bright texels in this direction.
    environment = mi.load_file(str(path)).environment()
    interaction = mi.SurfaceInteraction3f()
    interaction.wi = mi.Vector3f(*(-towards / np.linalg.norm(towards)))
    np.testing.assert_allclose(np.array(environment.eval(interaction)), (1000.0, 800.0, 600.0), rtol=0.01)
    mean = 2.0 * Environment(sky).mean_radiance()
    np.testing.assert_allclose(scene.environment.mean_radiance(), mean, rtol=1e-3)


def test_a_constant_environment_is_an_even_sky(tmp_path):
    more = '<emitter type="constant"><rgb name="radiance" value="1 2 3"/></emitter>'
    scene = read_mitsuba(scene_file(tmp_path, more=more))
    np.testing.assert_array_equal(scene.environment.radiance, [[[1.0, 2.0, 3.0]]])


def test_area_emitters_keep_their_shape_and_glow(tmp_path):
    """The flux that leaves a sphere of radius 0.5, whose triangles have 0.1 % less area, is π A L."""
    glowing = AREA_LIGHT.format(shape="sphere", more='<bsdf type="dielectric"/>')
    scene = read_mitsuba(scene_file(tmp_path, f"<scene>{glowing}<shape type='cube'/></scene>"))
    lamp, cube = (scene.materials[scene.meshes[i.mesh].material] for i in scene.instances)
    assert lamp.emission == (4.0, 2.0, 1.0) and not lamp.emits_both_ways
    assert not lamp.base_color.any() and not cube.glows
    mesh, to_world = scene.meshes[scene.instances[0].mesh], scene.instances[0].to_world
    corners = transform_points(to_world, mesh.positions)[mesh.triangles]
    vectors = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flux = math.pi * np.linalg.norm(vectors, axis=1).sum() * lamp.emission[0]
    assert flux == pytest.approx(math.pi * math.pi * 4.0, rel=2e-3)
    assert scene.lights == () and not any("light could" in line for line in scene.warnings)


def test_an_emitting_shape_without_a_material_is_black_as_in_mitsuba(tmp_path):
    text = f'<scene>{AREA_LIGHT.format(shape="rectangle", more="")}<shape type="rectangle"/></scene>'
    scene = read_mitsuba(scene_file(tmp_path, text))
    first, second = (scene.materials[scene.meshes[i.mesh].material] for i in scene.instances)
    assert not first.base_color.any() and first.glows
    np.testing.assert_array_equal(second.base_color, 0.5)
    assert not second.glows


CORNERS = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n"
OBJ_SHEETS = {
    "forward": CORNERS + "vn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n",
    "backward": CORNERS + "vn 0 0 -1\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n",
    "bare": CORNERS + "f 1 2 3\nf 1 3 4\n",
}


@pytest.mark.parametrize("shape", ["rectangle", "disk", "sphere", "cylinder", "cube", *OBJ_SHEETS])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("flags", ["", "flip_normals", "face_normals", "flip_normals face_normals"])
def test_light_leaves_the_side_that_it_leaves_in_mitsuba(tmp_path, shape, mirrored, flags):
    if "face_normals" in flags and shape in ("disk", "sphere", "cylinder"):
        pytest.skip("Mitsuba refuses the flag")
    kind, inner = shape, ""
    if shape in OBJ_SHEETS:
        (tmp_path / "a.obj").write_text(OBJ_SHEETS[shape])
        kind, inner = "obj", '<string name="filename" value="a.obj"/>'
    inner += "".join(f'<boolean name="{flag}" value="true"/>' for flag in flags.split())
    inner += f'<transform name="to_world"><scale z="{-1 if mirrored else 1}"/></transform>'
    text = f'<scene version="3.0.0"><shape type="{kind}">{inner}<emitter type="area"/></shape></scene>'
    path = scene_file(tmp_path, text)
    # A ray from outside.
    origin, along = [0.1, 0.2, 3.0], [0.0, 0.0, -1.0]
    if shape == "cylinder":
        origin, along = [0.0, 3.0, -0.5 if mirrored else 0.5], [0.0, -1.0, 0.0]
    mi.set_variant("scalar_rgb")
    theirs = mi.load_file(str(path))
    hit = theirs.ray_intersect(mi.Ray3f(origin, along))
    emits_out = float(hit.shape.emitter().eval(hit)[0]) > 0.0
    scene = read_mitsuba(path)
    (instance,) = scene.instances
    mesh = scene.meshes[instance.mesh]
    corners = transform_points(instance.to_world, mesh.positions)[mesh.triangles]
    nearest = np.linalg.norm(corners.mean(axis=1) - np.array(hit.p), axis=1).argmin()
    first, second, third = corners[nearest]
    outwards = -np.array(along)
    assert (np.cross(second - first, third - first) @ outwards > 0.0) == emits_out
    normals = transform_normals(instance.to_world, mesh.normals)[mesh.triangles[nearest]]
    assert (normals.mean(axis=0) @ outwards > 0.0) == emits_out


def test_all_lights_are_kept(tmp_path):
    bulb = '<emitter type="point"><rgb name="intensity" value="{}"/></emitter>'
    scene = read_mitsuba(scene_file(tmp_path, more=bulb.format(5.0) + bulb.format(1e-4) * 40))
    assert len(scene.lights) == 41
