"""Import of Mitsuba scenes, compared with what Mitsuba itself renders."""

import json
import math

import mitsuba as mi
import numpy as np
import OpenEXR
import pytest
from mitsuba_files import AREA_LIGHT, SIZE, scene_file

from vpltune import Runtime
from vpltune.cli.program import run
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.mitsuba_import import read_mitsuba
from vpltune.renderer.scene.placement import with_environment
from vpltune.renderer.scene.placement.scene_sidecar import read_sidecar
from vpltune.renderer.scene.views import View


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
