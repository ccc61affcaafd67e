"""The cone of a spot: one rule for every file, flag and call, and one falloff in every renderer."""

import json
import math

import numpy as np
import pytest
from built_scenes import colored_room

from vpltune.cli.view_flags import ViewFlags, light_from_flags
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.dynamic_lights import spot_lights
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.light_faces import light_records
from vpltune.renderer.scene.mitsuba_import import read_mitsuba
from vpltune.renderer.scene.placement.scene_sidecar import read_sidecar
from vpltune.renderer.scene.scene import Light
from vpltune.renderer.scene.spot_cone import cone_scale
from vpltune.renderer.scene.sun_faces import SunGrid
from vpltune.renderer.scene.views import read_views
from vpltune.tuner.reference.punctual_lights import _light_table
from vpltune.tuner.reference.unit_triangles import unit_triangles

# A right angle in single precision: 4e-8 more than π/2.
WIDEST = float(np.float32(math.pi / 2))


def of_gltf(folder, inner, outer):
    light = {"type": "spot", "spot": {"innerConeAngle": inner, "outerConeAngle": outer}}
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}],
        "extensions": {"KHR_lights_punctual": {"lights": [light]}},
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"uri": "a.bin", "byteLength": 36}],
    }
    (folder / "a.bin").write_bytes(np.array([0, 0, 0, 1, 0, 0, 0, 1, 0], np.float32).tobytes())
    (folder / "a.gltf").write_text(json.dumps(document))
    (light,) = read_scene(folder / "a.gltf").lights
    return light.inner_cone, light.outer_cone


def of_mitsuba(folder, inner, outer):
    beam, cutoff = math.degrees(inner), math.degrees(outer)
    (folder / "a.xml").write_text(
        f"""<scene version="3.0.0"><shape type="cube"/><emitter type="spot">
        <float name="beam_width" value="{beam!r}"/><float name="cutoff_angle" value="{cutoff!r}"/>
        </emitter></scene>"""
    )
    (light,) = read_mitsuba(folder / "a.xml").lights
    return light.inner_cone, light.outer_cone


def of_views(folder, inner, outer):
    spot = {"type": "spot", "intensity": [1, 1, 1], "position": [0, 2, 0], "direction": [0, -1, 0]}
    camera = {"to_world": np.eye(4).ravel().tolist(), "yfov": 0.8}
    view = {"name": "a", "split": "fitted", "size": [8, 6], "camera": camera}
    view["lights"] = [spot | {"inner_cone": inner, "outer_cone": outer}]
    (folder / "views.json").write_text(json.dumps({"views": [view]}))
    (light,) = read_views(folder / "views.json")[0].lights
    return light.inner_cone, light.outer_cone


def of_sidecar(folder, inner, outer):
    (folder / "a.vpltune.toml").write_text(
        f"""[[light]]\ntype = "spot"\nposition = [0, 1, 0]\ndirection = [0, -1, 0]\nintensity = 1
        inner_cone_degrees = {math.degrees(inner)!r}\nouter_cone_degrees = {math.degrees(outer)!r}\n"""
    )
    (light,) = read_sidecar(folder / "a.vpltune.toml").lights
    return light.inner_cone, light.outer_cone


def of_flags(folder, inner, outer):
    cone = f"{math.degrees(inner)!r},{math.degrees(outer)!r}"
    spot = {"light_type": "spot", "light_position": "0,1,0", "light_direction": "0,-1,0"}
    light = light_from_flags(ViewFlags(**spot, light_cone=cone))
    return light.inner_cone, light.outer_cone


def of_dynamic_lights(folder, inner, outer):
    """From the record: its scale gives the inner angle back."""
    (record,) = spot_lights(np.zeros((1, 3)), np.ones(3), 1.0, np.array([[0.0, 0.0, 1.0]]), inner, outer)
    cos_outer = float(record["cos_outer"])
    assert cos_outer >= 0.0
    return math.acos(min(cos_outer + 1.0 / float(record["cone_scale"]), 1.0)), math.acos(cos_outer)


SOURCES = [of_gltf, of_mitsuba, of_views, of_sidecar, of_flags, of_dynamic_lights]


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(
    ("inner", "outer", "drawn"),
    [
        (0.2, 0.6, (0.2, 0.6)),
        (0.6, 0.6, (0.999 * 0.6, 0.6)),
        (0.0, WIDEST, (0.0, math.pi / 2)),
        (WIDEST, WIDEST, (0.999 * math.pi / 2, math.pi / 2)),
    ],
    ids=["soft", "hard", "half a sphere", "hard half sphere"],
)
def test_every_source_has_the_same_rule(tmp_path, source, inner, outer, drawn):
    """To 1e-4: records are in single precision, which rounds the cosine of a small angle."""
    found = source(tmp_path, inner, outer)
    assert found[1] <= math.pi / 2
    assert found == pytest.approx(drawn, abs=1e-4)


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize(("inner", "outer"), [(0.6, 0.5), (-0.1, 0.5), (0.0, 0.0), (0.0, 3.2)])
def test_what_is_no_cone_is_refused_by_every_source(tmp_path, source, inner, outer):
    """3.2 exceeds π too, up to which Mitsuba's spots are cut down."""
    with pytest.raises(InputError, match=r"cone angles must satisfy 0 ≤ \w+ ≤ \w+ ≤ \S+ (radians|degrees)"):
        source(tmp_path, inner, outer)


@pytest.mark.parametrize("degrees", [0.1, 0.5, 1.7, 2.0, 40.0])
def test_runtime_and_reference_have_the_same_falloff(degrees):
    """Also where the least difference of the cosines bounds it, below 1.8°. To the rounding of float32."""
    outer = math.radians(degrees)
    light = Light("spot", np.ones(3), inner_cone=0.999 * outer, outer_cone=outer)
    records = light_records((light,), np.array([[-1.0] * 3, [1.0] * 3]), SunGrid(256, (0.0, 0.0, 0.0)))
    of_runtime = float(records.lights["direction_cone_scale"][0, 3])
    of_reference = float(_light_table(unit_triangles(colored_room()), (light,))[0, 3, 1])
    assert of_reference == pytest.approx(of_runtime, rel=1e-6)
    assert of_runtime == pytest.approx(cone_scale(0.999 * outer, outer), rel=1e-6)
    assert (of_runtime == pytest.approx(1e6)) == (degrees < 1.8)
