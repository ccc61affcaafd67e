"""Import of Mitsuba scenes, compared with what Mitsuba itself renders."""

import json
import math

import mitsuba as mi
import numpy as np
import OpenEXR
import pytest
from PIL import Image

from vpltune import Runtime
from vpltune.cli.program import run
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.environment import Environment, solid_angles, texel_directions
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.mitsuba_import import read_mitsuba
from vpltune.renderer.scene.placement import with_environment
from vpltune.renderer.scene.placement.scene_sidecar import read_sidecar
from vpltune.renderer.scene.transforms import transform_normals, transform_points
from vpltune.renderer.scene.views import View

SIZE = (96, 64)

# Every shape and every step of a transform, with the names of version 0.5 or of version 3.
SCENE = """<scene version="{version}">
  <default name="tilt" value="25"/>
  <sensor type="perspective">
    <float name="fov" value="50"/>
    <transform name="{to_world}"><lookat origin="0.5, 2, 9" target="0.2, 0.1, 0" up="0.1, 1, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="96"/><integer name="height" value="64"/></film>
  </sensor>
  <bsdf type="twosided" id="image"><bsdf type="diffuse">
    <texture name="reflectance" type="bitmap"><string name="filename" value="tex/image.png"/></texture>
  </bsdf></bsdf>
  <bsdf type="twosided" id="green"><bsdf type="diffuse">
    <rgb name="reflectance" value="0.1, 0.6, 0.2"/>
  </bsdf></bsdf>
  <shape type="rectangle">
    <transform name="{to_world}">
      <scale value="6"/><rotate x="1" angle="-90"/><translate y="-1.5"/>
    </transform>
    <ref id="image"/>
  </shape>
  <shape type="cube">
    <transform name="{to_world}">
      <scale x="0.7" y="0.5" z="0.6"/><rotate y="1" angle="$tilt"/><translate x="-2.6" y="0.3"/>
    </transform>
    <ref id="image"/>
  </shape>
  <shape type="sphere">
    <point name="center" x="-0.6" y="0.4" z="0.5"/><float name="radius" value="0.8"/><ref id="image"/>
  </shape>
  <shape type="disk">
    <transform name="{to_world}">
      <matrix value="0.6 0 0.3 1.2 0 0.7 0 0.6 -0.3 0 0.6 0.2 0 0 0 1"/>
    </transform>
    <ref id="image"/>
  </shape>
  <shape type="cylinder">
    <point name="p0" x="2.4" y="-0.6" z="0"/><point name="p1" x="2.9" y="1.2" z="-0.4"/>
    <float name="radius" value="0.4"/><ref id="green"/>
  </shape>
  <shape type="obj">
    <string name="filename" value="bent.obj"/>
    <transform name="{to_world}"><scale value="0.5"/><translate x="0" y="1.9"/></transform><ref id="image"/>
  </shape>
  <shape type="ply">
    <string name="filename" value="bent.ply"/>
    <transform name="{to_world}"><scale value="0.5"/><translate x="1.6" y="2.1"/></transform><ref id="image"/>
  </shape>
  {more}
</scene>"""
OBJ = """v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 1
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"""
PLY = """ply\nformat ascii 1.0\nelement vertex 4
property float x\nproperty float y\nproperty float z\nproperty float u\nproperty float v
element face 2\nproperty list uchar int vertex_indices\nend_header
-1 -1 0 0 0\n1 -1 0 1 0\n1 1 0 1 1\n-1 1 1 0 1\n3 0 1 2\n3 0 2 3\n"""
AREA_LIGHT = """<shape type="{shape}">
  <transform name="to_world"><scale value="0.5"/><translate y="2"/></transform>{more}
  <emitter type="area"><rgb name="radiance" value="4, 2, 1"/></emitter></shape>"""


def scene_file(folder, text=None, version="3.0.0", more=""):
    (folder / "tex").mkdir(exist_ok=True)
    # A smooth image, since the two renderers filter differently. It has no symmetry, to reveal flips.
    v, u = np.mgrid[0:64, 0:64] / 63.0
    image = np.stack([0.2 + 0.7 * u, 0.9 - 0.6 * v, 0.3 + 0.4 * u * v], axis=-1)
    Image.fromarray((255 * image).astype(np.uint8)).save(folder / "tex" / "image.png")
    (folder / "bent.obj").write_text(OBJ)
    (folder / "bent.ply").write_text(PLY)
    to_world = "toWorld" if version.startswith("0") else "to_world"
    path = folder / "scene.xml"
    path.write_text(text or SCENE.format(version=version, to_world=to_world, more=more))
    return path


@pytest.mark.parametrize("version", ["0.5.0", "3.0.0"])
def test_mitsuba_sees_the_same_surfaces_and_colours(tmp_path, version):
    path = scene_file(tmp_path, version=version)
    assert run(["import", str(path), "-o", str(tmp_path / "scene.glb")]) == 0
    scene = read_scene(tmp_path / "scene.glb")
    view = View("main", "fitted", SIZE, scene.cameras[0], ())
    runtime = Runtime(scene)
    config = TunedConfig(ArtistParameters(vpl_count=1), quality=Quality(rsm_resolution=64), light=ONE_BOUNCE)
    depth, albedo, normal = (
        runtime.render(view, config, layer=layer) for layer in ("depth", "albedo", "normal")
    )
    their_depth, their_albedo, their_normal = _mitsuba_layers(path, view)
    seen = their_depth > 0.0
    assert (seen == (depth > 0.0)).mean() > 0.99
    # Round shapes are polygons here, 0.1 % flatter. Pixels on outlines may show either surface.
    near = seen & (np.abs(depth - their_depth) < 0.01 * their_depth)
    assert near.sum() > 0.97 * seen.sum()
    assert np.abs(albedo - their_albedo)[near].mean() < 0.01
    # Where an image repeats, a texel or a pixel is smoothed at the border.
    assert np.quantile(np.abs(albedo - their_albedo)[near], 0.94) < 0.03
    assert np.quantile(1.0 - (normal * their_normal).sum(axis=-1)[near], 0.97) < 0.002


def _mitsuba_layers(path, view):
    mi.set_variant("scalar_rgb")
    scene = mi.load_file(str(path))
    sensor = scene.sensors()[0]
    width, height = view.size
    depth, albedo, normal = (
        np.zeros((height, width)),
        np.zeros((height, width, 3)),
        np.zeros((height, width, 3)),
    )
    eye, forward = view.camera.position_world, -view.camera.to_world[:3, 2]
    for row in range(height):
        for column in range(width):
            place = [(column + 0.5) / width, (row + 0.5) / height]
            ray, _ = sensor.sample_ray(0.0, 0.5, place, [0.5, 0.5])
            hit = scene.ray_intersect(mi.Ray3f(ray))
            if hit.is_valid():
                depth[row, column] = (np.array(hit.p) - eye) @ forward
                albedo[row, column] = np.array(hit.bsdf().eval_diffuse_reflectance(hit))
                shading = np.array(hit.sh_frame.n)
                normal[row, column] = shading if shading @ np.array(ray.d) < 0.0 else -shading
    return depth, albedo, normal


@pytest.mark.parametrize(
    "lens",
    [
        '<float name="fov" value="40"/>',
        '<float name="fov" value="40"/><string name="fov_axis" value="y"/>',
        '<float name="fov" value="40"/><string name="fov_axis" value="smaller"/>',
        '<float name="fov" value="40"/><string name="fov_axis" value="larger"/>',
        '<float name="fov" value="40"/><string name="fov_axis" value="diagonal"/>',
        '<string name="focal_length" value="35mm"/>',
    ],
)
def test_every_way_to_give_the_angle_of_view(tmp_path, lens):
    sensor = f"""<sensor type="perspective">{lens}
      <film type="hdrfilm"><integer name="width" value="320"/><integer name="height" value="200"/></film>
      </sensor>"""
    path = scene_file(tmp_path, f'<scene version="3.0.0">{sensor}<shape type="sphere"/></scene>')
    mi.set_variant("scalar_rgb")
    x_fov = math.radians(float(np.array(mi.traverse(mi.load_file(str(path)).sensors()[0])["x_fov"]).item()))
    yfov = read_mitsuba(path).cameras[0].yfov
    assert yfov == pytest.approx(2.0 * math.atan(math.tan(x_fov / 2.0) * 200.0 / 320.0), rel=1e-5)


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


def test_what_cannot_be_brought_over_is_said(tmp_path):
    more = (
        '<shape type="sphere"><bsdf type="dielectric"/></shape>'
        '<shape type="sphere"><bsdf type="mask"><bsdf type="roughplastic">'
        '<rgb name="diffuse_reflectance" value="0.5"/></bsdf></bsdf></shape>'
        '<shape type="sphere"><bsdf type="conductor"><string name="material" value="Au"/></bsdf></shape>'
        '<emitter type="sunsky"/><medium type="homogeneous"/>'
    )
    said = "\n".join(read_mitsuba(scene_file(tmp_path, more=more)).warnings)
    for part in (
        "glass or empty",
        "see-through",
        "gloss",
        "metal",
        "emitter 'sunsky' is ignored",
        "media",
        "no light",
    ):
        assert part in said, part


def test_shapes_wind_outwards(tmp_path):
    for shape in ("rectangle", "cube", "sphere", "disk", "cylinder"):
        scene = read_mitsuba(scene_file(tmp_path, f'<scene><shape type="{shape}"/></scene>'))
        mesh = scene.meshes[0]
        corners = mesh.positions[mesh.triangles].astype(np.float64)
        by_winding = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert ((by_winding * mesh.normals[mesh.triangles].mean(axis=1)).sum(axis=1) > 0.0).all(), shape


def test_all_lights_are_kept(tmp_path):
    bulb = '<emitter type="point"><rgb name="intensity" value="{}"/></emitter>'
    scene = read_mitsuba(scene_file(tmp_path, more=bulb.format(5.0) + bulb.format(1e-4) * 40))
    assert len(scene.lights) == 41


def test_instances_place_the_shapes_of_their_group(tmp_path):
    text = """<scene version="3.0.0">
      <shape type="shapegroup" id="pair"><shape type="cube"/>
        <shape type="disk"><transform name="to_world"><translate z="5"/></transform></shape></shape>
      <shape type="instance"><ref id="pair"/><transform name="to_world"><translate x="9"/></transform></shape>
      <shape type="instance"><ref id="pair"/></shape></scene>"""
    scene = read_mitsuba(scene_file(tmp_path, text))
    places = sorted(tuple(instance.to_world[:3, 3]) for instance in scene.instances)
    assert places == [(0.0, 0.0, 0.0), (0.0, 0.0, 5.0), (9.0, 0.0, 0.0), (9.0, 0.0, 5.0)]
    assert len(scene.meshes) == 2


BOMB = """<?xml version="1.0"?><!DOCTYPE scene [<!ENTITY a "aaaaaaaaaa">
<!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">]>
<scene version="3.0.0"><string name="x" value="&c;"/></scene>"""
REFUSED = {
    "entity bomb": (BOMB, "DOCTYPE scene"),
    "external entity": (
        '<!DOCTYPE scene SYSTEM "file:///etc/passwd"><scene version="3.0.0"/>',
        "DOCTYPE scene",
    ),
    "not XML": ("<scene version='3.0.0'>", "not XML"),
    "empty": (" ", "not XML"),
    "not a scene": ("<svg/>", "line 1: <svg>: the root element of a Mitsuba scene must be <scene>"),
    "deep": ("<scene>" + '<bsdf type="twosided">' * 100, "at most 64 deep"),
    "no shapes": ('<scene version="3.0.0"/>', "the scene has no triangles"),
    "shape": (
        '<scene><shape type="hair"/></scene>',
        "line 1: shape 'hair': unsupported shape type; must be one of obj, ply",
    ),
    "material": ('<scene><shape type="cube"><bsdf type="velvet"/></shape></scene>', "bsdf 'velvet'"),
    "emitter": ('<scene><shape type="cube"/><emitter type="laser"/></scene>', "emitter 'laser'"),
    "element": ('<scene><shape type="cube"><wheel name="a"/></shape></scene>', "<wheel>: unknown element"),
    "no type": ("<scene><shape/></scene>", "attribute 'type' is missing"),
    "file": (
        '<scene><shape type="obj"><string name="filename" value="a.obj"/></shape></scene>',
        "'a.obj' does not exist",
    ),
    "file outside": (
        '<scene><shape type="obj"><string name="filename" value="../a.obj"/></shape></scene>',
        "must stay inside the scene's folder",
    ),
    "bad file": (
        '<scene><shape type="ply"><string name="filename" value="bent.obj"/></shape></scene>',
        "'bent.obj': ",
    ),
    "texture": (
        '<scene><shape type="cube"><bsdf type="diffuse"><texture name="reflectance" type="bitmap">'
        '<string name="filename" value="none.png"/></texture></bsdf></shape></scene>',
        "none.png",
    ),
    "NaN": (
        '<scene><shape type="sphere"><float name="radius" value="nan"/></shape></scene>',
        "value must be 1 finite number, got 'nan'",
    ),
    "radius 0": (
        '<scene><shape type="sphere"><float name="radius" value="0"/></shape></scene>',
        "above zero",
    ),
    "flat": (
        '<scene><shape type="cube"><transform name="to_world"><scale y="0"/></transform></shape></scene>',
        "must be finite and have an inverse",
    ),
    "default": (
        '<scene><shape type="sphere"><float name="radius" value="$r"/></shape></scene>',
        "has no <default>",
    ),
    "reference": (
        '<scene><shape type="cube"><ref id="m"/></shape></scene>',
        "no object with the id 'm' is defined before it",
    ),
    "negative": (
        '<scene><shape type="cube"><bsdf type="diffuse"><rgb name="reflectance" value="-1"/>'
        "</bsdf></shape></scene>",
        "must not be negative",
    ),
}


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED)
def test_refusals_are_one_line_that_names_the_file(tmp_path, capfd, text, message):
    path = scene_file(tmp_path, text)
    with pytest.raises(InputError) as refusal:
        read_mitsuba(path)
    assert str(refusal.value).startswith(f"{path}: ") and message in str(refusal.value)
    assert run(["import", str(path), "-o", str(tmp_path / "out.glb")]) == 2
    assert capfd.readouterr().err.count("\n") == 1
    assert not (tmp_path / "out.glb").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.glb", "-o", "b.glb"], "a.glb: a Mitsuba scene ends in .xml"),
        (["a.xml", "-o", "b.gltf"], "b.gltf: the file name must end in .glb"),
        (["absent.xml", "-o", "b.glb"], "absent.xml: cannot be read"),
    ],
)
def test_names_are_looked_at_first(tmp_path, capfd, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    assert run(["import", *arguments]) == 2
    assert message in capfd.readouterr().err


def test_an_environment_goes_beside_the_file(tmp_path, capfd):
    sky = np.random.default_rng(1).uniform(0.0, 3.0, (8, 16, 3)).astype(np.float32)
    OpenEXR.File({}, {"RGB": sky}).write(str(tmp_path / "sky.exr"))
    more = """<emitter type="envmap"><string name="filename" value="sky.exr"/></emitter>"""
    path = scene_file(tmp_path, more=more + AREA_LIGHT.format(shape="disk", more=""))
    output = tmp_path / "out" / "room.glb"
    output.parent.mkdir()
    (tmp_path / "out" / "room.vpltune.toml").write_text(
        '[[light]]\ntype = "point"\nposition = [1, 2, 3]\nintensity = 4\n'
    )
    assert run(["import", str(path), "-o", str(output), "--json"]) == 0
    report = json.loads(capfd.readouterr().out)
    assert report["environment"] == str(tmp_path / "out" / "room.environment.exr")
    sidecar = read_sidecar(tmp_path / "out" / "room.vpltune.toml")
    assert sidecar.lights[0].kind == "point" and sidecar.camera is None
    scene = with_environment(read_scene(output), output)
    np.testing.assert_array_equal(scene.environment.radiance, sky)
    (lamp,) = [material for material in scene.materials if material.glows]
    assert lamp.emission == (4.0, 2.0, 1.0) and not lamp.emits_both_ways


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "triangles", "lights"),
    [("bitterli-living-room", 131_807, 0), ("bitterli-staircase2", 28_859, 0)],
)
def test_the_shared_scenes_come_over(scenes_folder, tmp_path, capfd, name, triangles, lights):
    output = tmp_path / "scene.glb"
    assert run(["import", str(scenes_folder / name / "scene.xml"), "-o", str(output), "--json"]) == 0
    report = json.loads(capfd.readouterr().out)
    assert (report["triangles"], report["lights"], report["cameras"]) == (triangles, lights, 1)
    scene = read_scene(output)
    assert scene.triangle_count() == triangles
    assert report["approximated"] == list(json.loads(_glb_json(output))["asset"]["extras"]["notes"])


def _glb_json(path):
    content = path.read_bytes()
    return content[20 : 20 + int.from_bytes(content[12:16], "little")]
