"""Import of the skies that Mitsuba computes, compared with what Mitsuba itself renders."""

import json
import math

import mitsuba as mi
import numpy as np
import pytest
from mitsuba_files import scene_file

from vpltune.cli.program import run
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.environment import solid_angles, texel_directions
from vpltune.renderer.scene.files.scene_reader import read_scene
from vpltune.renderer.scene.mitsuba_import import read_mitsuba
from vpltune.renderer.scene.placement import with_environment
from vpltune.tuner.reference.sun_sky_baking import baked_sun_sky

# A level square of albedo 0.5, which nothing shadows, and a camera that looks down at its middle.
GROUND = """<scene version="{version}"><integrator type="direct"/>
  <sensor type="perspective"><float name="fov" value="10"/>
    <transform name="to_world"><lookat origin="{up}" target="0, 0, 0" up="1, 0, 0"/></transform>
    <film type="hdrfilm"><integer name="width" value="16"/><integer name="height" value="16"/>
      <rfilter type="box"/></film>
    <sampler type="independent"><integer name="sample_count" value="1024"/></sampler></sensor>
  <shape type="rectangle"><transform name="to_world"><scale value="5"/>{flat}</transform>
    <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>
  {emitter}</scene>"""
LIES = {"y": '<rotate x="1" angle="-90"/>', "z": ""}
UP = {"y": "0, 3, 0", "z": "0, 0, 3"}
UPRIGHT = '<transform name="to_world"><rotate x="1" angle="-90"/>{}</transform>'
MEASURED = '<vector name="sun_direction" x="0.5" y="0.7" z="0.6"/>'


def ground(folder, emitter, up="y", version="3.0.0"):
    """The scene's file."""
    text = GROUND.format(version=version, emitter=emitter, flat=LIES[up], up=UP[up])
    return scene_file(folder, text)


def emitter(inner="", kind="sunsky"):
    return f'<emitter type="{kind}">{inner}</emitter>'


def imported(path):
    return read_mitsuba(path, baked_sun_sky)


def irradiance(scene, normal):
    """What the imported light gives to a surface without shadows, RGB in W/m²: a sum over texels and suns."""
    total = np.zeros(3)
    if scene.environment is not None:
        radiance = scene.environment.radiance.astype(np.float64)
        size = radiance.shape[:2]
        cosine = np.maximum(texel_directions(*size) @ normal, 0.0) * solid_angles(*size)[:, None]
        total += np.einsum("hw,hwc->c", cosine, radiance)
    for light in scene.lights:
        total += max(-float(light.direction_world @ normal), 0.0) * light.intensity
    return total


def towards_sun(scene):
    (sun,) = scene.lights
    assert sun.kind == "directional"
    return -sun.direction_world


def mitsuba_irradiance(path):
    """What Mitsuba renders: a diffuse surface has the radiance ρ E ⁄ π."""
    mi.set_variant("scalar_rgb")
    image = np.array(mi.render(mi.load_file(str(path)), seed=1))
    return image.mean(axis=(0, 1), dtype=np.float64) * math.pi / 0.5


@pytest.mark.parametrize(
    ("up", "inner"),
    [
        ("z", ""),
        ("y", UPRIGHT.format("")),
        ("y", UPRIGHT.format('<rotate y="1" angle="77"/>') + MEASURED),
        ("y", UPRIGHT.format('<rotate x="0.28" z="0.96" angle="20"/>') + MEASURED),
        ("z", '<float name="turbidity" value="8"/><rgb name="albedo" value="0.1, 0.5, 0.9"/>'),
        ("z", '<float name="hour" value="17"/><float name="latitude" value="48"/>'),
        ("z", '<float name="sun_scale" value="0"/><float name="sky_scale" value="2"/>'),
        ("z", '<float name="sky_scale" value="0"/><float name="sun_scale" value="0.5"/>'),
        ("z", '<float name="sun_aperture" value="20"/>' + MEASURED),
        ("z", '<float name="sun_aperture" value="0.1"/>' + MEASURED),
        ("z", '<boolean name="complex_sun" value="true"/>' + MEASURED),
    ],
    ids=["default", "upright", "turned", "tilted", "hazy", "evening", "sky", "sun", "wide", "narrow", "limb"],
)
def test_level_ground_gets_what_it_gets_in_mitsuba(tmp_path, capfd, up, inner):
    """1 %: Mitsuba's 262,144 samples have a noise of 0.4 %; its single precision errs by 0.2 % for a sun."""
    path = ground(tmp_path, emitter(inner), up)
    output = tmp_path / "ground.glb"
    assert run(["import", str(path), "-o", str(output), "--json"]) == 0
    capfd.readouterr()
    scene = with_environment(read_scene(output), output)
    normal = np.array([0.0, 1.0, 0.0] if up == "y" else [0.0, 0.0, 1.0])
    np.testing.assert_allclose(irradiance(scene, normal), mitsuba_irradiance(path), rtol=0.02)


@pytest.mark.parametrize("inner", ["", MEASURED], ids=["time", "direction"])
@pytest.mark.parametrize(
    "turn",
    ["", '<rotate x="0.36" y="0.48" z="-0.8" angle="310"/>', '<scale x="-1"/><rotate y="1" angle="40"/>'],
    ids=["unturned", "any", "mirrored"],
)
def test_sky_and_sun_are_where_mitsuba_has_them(tmp_path, inner, turn):
    path = ground(tmp_path, emitter(f'<transform name="to_world">{turn}</transform>{inner}'))
    scene = imported(path)
    mi.set_variant("scalar_rgb")
    environment = mi.load_file(str(path)).environment()
    towards = towards_sun(scene)

    def theirs(direction):
        interaction = mi.SurfaceInteraction3f()
        interaction.wi = mi.Vector3f(*(-direction))
        return np.array(environment.eval(interaction))

    # The sun's disc has a radius of 0.27°: what is within 0.2° of its middle is a thousand times the sky.
    across = np.cross(towards, np.eye(3)[np.abs(towards).argmin()])
    across /= np.linalg.norm(across)
    for side in (across, -across, np.cross(towards, across), -np.cross(towards, across)):
        assert theirs(towards + math.radians(0.2) * side)[1] > 1000.0
    # Texels of 1.4° in a map that was turned; Mitsuba's sky at their middles, away from sun and horizon.
    size = scene.environment.radiance.shape[:2]
    directions = texel_directions(*size)[5::16, 5::16].reshape(-1, 3)
    ours = scene.environment.radiance[5::16, 5::16].reshape(-1, 3)
    zenith = np.linalg.inv(np.array(mi.traverse(environment)["to_world"].matrix)[:3, :3])[2]
    heights = directions @ (zenith / np.linalg.norm(zenith))
    seen = (heights > 0.1) & (directions @ towards < 0.95)
    assert seen.sum() > 50 and (heights < -0.05).sum() > 50
    found = np.array([theirs(direction) for direction in directions])
    # 3 %: what the sky's radiance changes by over half a texel.
    np.testing.assert_allclose(ours[seen], found[seen], rtol=0.03)
    assert not ours[heights < -0.05].any() and not found[heights < -0.05].any()


@pytest.mark.parametrize(
    ("kind", "version", "names"),
    [
        ("sky", "0.6.0", ("sunDirection", "scale")),
        ("sun", "0.6.0", ("sunDirection", "scale")),
        ("sunsky", "0.6.0", ("sunDirection", "scale")),
        ("sky", "3.0.0", ("sun_direction", "scale")),
        ("sun", "3.0.0", ("sun_direction", "sun_scale")),
    ],
)
def test_the_names_of_version_06(tmp_path, kind, version, names):
    """The same sky as that of `sunsky` in a scene of version 3 that is set upright."""
    direction, scale = names
    turn = '<rotate y="1" angle="25"/>'
    inner = f"""<vector name="{direction}" x="0.5" y="0.7" z="0.6"/><float name="{scale}" value="3"/>
      <integer name="resolution" value="512"/><float name="sunRadiusScale" value="2"/>"""
    to_world = "toWorld" if version < "2" else "to_world"
    old = emitter(f'{inner}<transform name="{to_world}">{turn}</transform>', kind)
    found = imported(ground(tmp_path, old, version=version))
    of_sky, of_sun = (3.0 * (kind != "sun"), 3.0 * (kind != "sky"))
    new = f"""{UPRIGHT.format(turn)}{MEASURED}<rgb name="albedo" value="0.2"/>
      <float name="sky_scale" value="{of_sky}"/><float name="sun_scale" value="{of_sun}"/>"""
    (tmp_path / "new").mkdir()
    expected = imported(ground(tmp_path / "new", emitter(new)))
    assert (found.environment is None) == (kind == "sun") and len(found.lights) == (kind != "sky")
    for ours, theirs in zip(found.lights, expected.lights, strict=True):
        # Rounding of Mitsuba's single precision.
        np.testing.assert_allclose(ours.intensity, theirs.intensity, rtol=1e-4)
        np.testing.assert_allclose(ours.direction_world, theirs.direction_world, atol=1e-6)
    if found.environment is not None:
        np.testing.assert_allclose(
            found.environment.radiance, expected.environment.radiance, rtol=1e-3, atol=1e-5
        )
    assert any("Mitsuba 0.6" in line for line in found.warnings)


@pytest.mark.parametrize(("hour", "east"), [(8, 1.0), (16, -1.0)])
def test_the_sun_of_version_06_rises_in_the_east(tmp_path, hour, east):
    """+X is the east, −Z the north; at 36° north, on 1 March, the sun stands in the south."""
    values = {"hour": hour, "month": 3, "day": 1}
    time = "".join(f'<integer name="{name}" value="{value}"/>' for name, value in values.items())
    x, y, z = towards_sun(imported(ground(tmp_path, emitter(time), version="0.6.0")))
    assert east * x > 0.5 and y > 0.1 and z > 0.1


def test_the_sun_of_version_06_is_as_high_as_that_of_version_3(tmp_path):
    time = '<float name="hour" value="10.5"/><float name="longitude" value="120"/>'
    old = towards_sun(imported(ground(tmp_path, emitter(time), version="0.6.0")))
    new = towards_sun(imported(ground(tmp_path, emitter(time), "z")))
    assert old[1] == pytest.approx(new[2], abs=1e-6)  # single precision


def test_a_stretched_sky_reaches_below_the_horizon(tmp_path):
    """Stretched twofold, the sky is as bright at the polar angle 2 θ as it is at θ otherwise."""
    plain = imported(ground(tmp_path, emitter(MEASURED), version="0.6.0"))
    stretched = emitter(MEASURED + '<float name="stretch" value="2"/>')
    scene = imported(ground(tmp_path, stretched, version="0.6.0"))
    height = len(plain.environment.radiance)
    assert not plain.environment.radiance[height // 2 :].any() and scene.environment.radiance[-1].all()
    # Texels 2 k and 2 k + 1 of the stretched map lie beside the polar angle of texel k of the other one.
    pairs = scene.environment.radiance.reshape(height // 2, 2, -1, 3).mean(axis=1)
    rows = slice(8, height // 2 - 8)
    # 5 %: how much two neighbours differ from their mean, close to the sun.
    np.testing.assert_allclose(pairs[rows], plain.environment.radiance[rows], rtol=0.05)
    polar = [math.acos(towards_sun(each)[1]) for each in (plain, scene)]
    assert polar[1] == pytest.approx(2.0 * polar[0], abs=1e-6)


def test_an_extended_sky_fades_below_the_horizon(tmp_path):
    extended = emitter(MEASURED + '<boolean name="extend" value="true"/>')
    plain = imported(ground(tmp_path, emitter(MEASURED), version="0.6.0")).environment.radiance
    radiance = imported(ground(tmp_path, extended, version="0.6.0")).environment.radiance
    half = len(radiance) // 2
    np.testing.assert_array_equal(radiance[:half], plain[:half])
    means = radiance[half:].mean(axis=(1, 2))
    assert (np.diff(means) < 0.0).all() and means[-1] < 1e-3 * means[0]
    # A smooth step is ½ half way down.
    assert means[half // 2] == pytest.approx(0.5 * means[0], rel=0.02)  # a texel is 2 % of the way


@pytest.mark.parametrize(
    ("inner", "message"),
    [
        ('<float name="turbidity" value="0.5"/>', "turbidity must be from 1 to 10, got 0.5"),
        ('<float name="turbidity" value="11"/>', "turbidity must be from 1 to 10, got 11"),
        ('<string name="turbidity" value="3"/>', "'turbidity' must be a number"),
        ('<float name="turbidty" value="3"/>', "'turbidty' is not a parameter of it"),
        ('<rgb name="albedo" value="0, 0, 1.5"/>', r"albedo must be from 0 to 1, got \[0.0, 0.0, 1.5\]"),
        ('<texture type="checkerboard" name="albedo"/>', "'albedo' must be a colour"),
        ('<vector name="sun_direction"/>', "its direction must not be zero"),
        ('<float name="sun_direction"/>', "attribute 'value' is missing"),
        (MEASURED + '<float name="hour" value="3"/>', "must have sun_direction or hour, not both"),
        ('<float name="latitude" value="91"/>', "latitude must be from -90 to 90, got 91"),
        ('<integer name="month" value="13"/>', "month must be from 1 to 12, got 13"),
        ('<float name="day" value="1.5"/>', "day must be a whole number, got 1.5"),
        ('<float name="hour" value="-1"/>', "hour must be from 0 to 24, got -1"),
        ('<float name="sun_aperture" value="0"/>', r"sun_aperture must lie in \(0, 180\) degrees, got 0"),
        ('<float name="sun_scale" value="-1"/>', "sun_scale must be from 0 to 1e\\+18, got -1"),
        ('<float name="sky_scale" value="1e19"/>', "sky_scale must be from 0 to 1e\\+18, got 1e\\+19"),
        ('<float name="sun_scale" value="1e18"/>', "it must give at most 1e\\+18 W/m²"),
        ('<float name="stretch" value="3"/>', "stretch must be from 1 to 2, got 3"),
        ('<boolean name="to_world" value="true"/>', "'to_world' must be a transform"),
    ],
)
def test_an_invalid_parameter_is_one_line(tmp_path, inner, message):
    path = ground(tmp_path, emitter(inner))
    with pytest.raises(InputError, match=r"scene\.xml: line \d+: .*" + message) as caught:
        imported(path)
    assert "\n" not in str(caught.value)


def test_what_is_dropped_is_said(tmp_path):
    said = imported(ground(tmp_path, emitter())).warnings
    assert said == (
        "the sun is a directional light: its shadows are sharp, and its disc is not seen in the sky",
    )
    night = imported(ground(tmp_path, emitter('<float name="hour" value="0"/>')))
    assert night.environment is None and night.lights == ()
    assert night.warnings[0] == "emitter 'sunsky' is ignored: its sun is below the horizon"
    dawn = imported(ground(tmp_path, emitter('<vector name="sun_direction" x="1" z="0.01"/>'), "z"))
    assert dawn.lights[0].intensity.min() == 0.0 and any("outside sRGB" in line for line in dawn.warnings)
    skewed = emitter('<transform name="to_world"><scale x="2"/></transform>')
    assert any("but not stretched" in line for line in imported(ground(tmp_path, skewed)).warnings)


def test_a_scene_has_one_sky_and_one_sun(tmp_path):
    constant = '<emitter type="constant"><rgb name="radiance" value="1 2 3"/></emitter>'
    scene = imported(ground(tmp_path, constant + emitter() + emitter()))
    np.testing.assert_array_equal(scene.environment.radiance, [[[1.0, 2.0, 3.0]]])
    assert len(scene.lights) == 1
    said = "\n".join(scene.warnings)
    assert "the sky of line" in said and "the sun of line" in said
    apart = imported(ground(tmp_path, emitter(kind="sun") + emitter(kind="sky") + constant))
    assert len(apart.lights) == 1 and apart.environment.radiance.size > 3
    assert any("'constant' is ignored" in line for line in apart.warnings)


def test_without_mitsuba_it_is_ignored(tmp_path):
    scene = read_mitsuba(ground(tmp_path, emitter()))
    assert scene.environment is None and scene.lights == ()
    assert scene.warnings[0] == (
        "emitter 'sunsky' is ignored: Mitsuba computes it, which needs vpltune[tuner]"
    )


def test_the_command_writes_the_sun_and_the_sky(tmp_path, capfd):
    path = ground(tmp_path, emitter(UPRIGHT.format("") + MEASURED))
    output = tmp_path / "ground.glb"
    assert run(["import", str(path), "-o", str(output), "--json"]) == 0
    report = json.loads(capfd.readouterr().out)
    assert report["lights"] == 1 and report["environment"] == str(tmp_path / "ground.environment.exr")
    scene = with_environment(read_scene(output), output)
    towards = np.array([0.5, 0.7, 0.6]) / math.sqrt(1.1)
    np.testing.assert_allclose(towards_sun(scene), towards, atol=1e-6)  # glTF has single precision
    # At the sun's height, the sky is brightest where the sun is.
    row = round(math.acos(towards[1]) / math.pi * 256)
    brightest = scene.environment.radiance[row].sum(axis=1).argmax()
    assert texel_directions(256, 512)[row, brightest] @ towards > math.cos(math.radians(2.0))
