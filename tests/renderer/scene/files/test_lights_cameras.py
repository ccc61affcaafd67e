"""Punctual lights and cameras, placed as in KHR_lights_punctual and glTF 2.0 section 3.10."""

import numpy as np
import pytest

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene

HALF = np.sqrt(0.5)


def with_light(triangle, light, **node):
    triangle.document["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    triangle.document["extensionsUsed"] = ["KHR_lights_punctual"]
    triangle.add("nodes", node | {"extensions": {"KHR_lights_punctual": {"light": 0}}})
    triangle.document["scenes"] = [{"nodes": [0, 1]}]
    return triangle.write()


def test_a_spot_shines_along_minus_z_of_its_node_whatever_its_scale(triangle):
    light = {
        "type": "spot",
        "color": [1, 0.5, 0.25],
        "intensity": 40,
        "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.3},
    }
    # A quarter turn about x maps −z to +y.
    path = with_light(triangle, light, translation=[1, 2, 3], rotation=[HALF, 0, 0, HALF], scale=[5, 5, 5])
    (spot,) = read_scene(path).lights
    assert spot.kind == "spot"
    np.testing.assert_allclose(spot.position_world, [1, 2, 3])
    np.testing.assert_allclose(spot.direction_world, [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(spot.intensity, [40, 20, 10])
    assert (spot.inner_cone, spot.outer_cone) == (0.1, 0.3)


def test_defaults_of_the_extension(triangle):
    (spot,) = read_scene(with_light(triangle, {"type": "spot", "spot": {}})).lights
    np.testing.assert_array_equal(spot.intensity, [1, 1, 1])
    np.testing.assert_allclose(spot.direction_world, [0, 0, -1])
    assert (spot.inner_cone, spot.outer_cone) == (0.0, np.pi / 4)


@pytest.mark.parametrize("kind", ["point", "directional"])
def test_point_and_directional(triangle, kind):
    path = with_light(triangle, {"type": kind, "intensity": 3}, rotation=[0, HALF, 0, HALF])
    (light,) = read_scene(path).lights
    assert light.kind == kind
    np.testing.assert_array_equal(light.intensity, [3, 3, 3])
    if kind == "directional":
        # A quarter turn about y maps −z to −x.
        np.testing.assert_allclose(light.direction_world, [-1, 0, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"intensity": -1}, r"lights\[0\]\.intensity: must be a finite number from 0 to 1e\+30, got -1"),
        ({"intensity": 1e31}, r"lights\[0\]\.intensity: must be a finite number"),
        (
            {"intensity": 1e19},
            r"intensity must be at most 1e\+18 W/sr in a scene 1\.41 units",
        ),
        ({"color": [1, -1, 1]}, r"lights\[0\]\.color: must not be negative"),
        ({"color": [1, 1]}, r"lights\[0\]\.color: must be a list of 3 finite numbers"),
        ({"type": "laser"}, r"lights\[0\]\.type: must be 'point', 'spot' or 'directional', got 'laser'"),
        (
            {"spot": {"innerConeAngle": 0.5, "outerConeAngle": 0.4}},
            r"lights\[0\]\.spot: cone angles must satisfy",
        ),
        ({"spot": {"outerConeAngle": 2}}, r"lights\[0\]\.spot: cone angles must satisfy"),
        ({"spot": {"outerConeAngle": 0}}, r"lights\[0\]\.spot: cone angles must satisfy"),
        ({"spot": {"innerConeAngle": -0.1}}, r"lights\[0\]\.spot: cone angles must satisfy"),
        (
            {"range": 0},
            r"lights\[0\]\.range: must be a finite number from 1e-30 to 1e\+18, got 0",
        ),
        ({"range": -2.5}, r"lights\[0\]\.range: must be a finite number from 1e-30 .*, got -2\.5"),
        ({"range": True}, r"lights\[0\]\.range: must be a finite number"),
        ({"range": "far"}, r"lights\[0\]\.range: must be a finite number"),
        ({"range": None}, r"lights\[0\]\.range: must be a finite number"),
    ],
)
def test_lights_out_of_range_are_refused(triangle, change, message):
    with pytest.raises(InputError, match=message):
        read_scene(with_light(triangle, {"type": "spot", "spot": {}} | change))


def test_equal_cone_angles_are_a_hard_edge_with_a_word(triangle):
    """Blender writes them for a spot without blend."""
    path = with_light(triangle, {"type": "spot", "spot": {"innerConeAngle": 0.6, "outerConeAngle": 0.6}})
    scene = read_scene(path)
    (spot,) = scene.lights
    assert spot.outer_cone == 0.6
    # The falloff is a thousandth of the half angle: what the renderer needs to divide by.
    assert 0.0 < 0.6 - spot.inner_cone < 0.002 * 0.6
    assert scene.warnings == ("1 spot has equal cone angles; it has a hard edge",)


@pytest.mark.parametrize("kind", ["point", "spot"])
def test_a_range_is_read_whatever_the_scale_of_the_node(triangle, kind):
    """KHR_lights_punctual: scale does not affect a light."""
    scene = read_scene(with_light(triangle, {"type": kind, "range": 5}, scale=[3, 3, 3]))
    assert scene.lights[0].range == 5.0
    assert scene.warnings == ()


def test_without_a_range_or_with_a_vast_one_light_does_not_end(triangle):
    vast = (1e18, 1e30, 3.4028234663852886e38, 1.7e308, 10**400)
    for light in ({"type": "point"}, *({"type": "point", "range": value} for value in vast)):
        (point,) = read_scene(with_light(triangle, light)).lights
        assert point.range == np.inf


def test_the_range_of_a_sun_is_passed_over(triangle):
    (sun,) = read_scene(with_light(triangle, {"type": "directional", "range": -1})).lights
    assert sun.range == np.inf


def test_a_light_that_is_not_there_is_refused(triangle):
    path = with_light(triangle, {"type": "point"})
    text = path.read_text().replace('"light": 0', '"light": 3')
    path.write_text(text)
    with pytest.raises(InputError, match="light: must be an index into the 1 lights, got 3"):
        read_scene(path)


def with_camera(triangle, camera, **node):
    triangle.document["cameras"] = [camera]
    triangle.add("nodes", node | {"camera": 0})
    triangle.document["scenes"] = [{"nodes": [0, 1]}]
    return triangle.write()


PERSPECTIVE = {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1, "aspectRatio": 2.0}}


def test_a_camera_loses_its_scale_and_keeps_its_view(triangle):
    path = with_camera(
        triangle, PERSPECTIVE, translation=[1, 2, 3], rotation=[0, HALF, 0, HALF], scale=[2, 3, 4]
    )
    (camera,) = read_scene(path).cameras
    assert camera.yfov == 0.7
    expected = [[0, 0, 1, 1], [0, 1, 0, 2], [-1, 0, 0, 3], [0, 0, 0, 1]]
    np.testing.assert_allclose(camera.to_world, expected, atol=1e-12)


def test_a_camera_is_rigid_under_shear_and_mirroring(triangle):
    path = with_camera(triangle, PERSPECTIVE, matrix=[-1, 0, 0, 0, 0.5, 2, 0, 0, 0, 0, 3, 0, 0, 0, 0, 1])
    rotation = read_scene(path).cameras[0].to_world[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(rotation[:, 2], [0, 0, 1])


@pytest.mark.parametrize("yfov", [0, -1, 7, "wide", None])
def test_impossible_angles_of_view_are_refused(triangle, yfov):
    camera = {"type": "perspective", "perspective": {"yfov": yfov, "znear": 0.1}}
    with pytest.raises(InputError, match=r"cameras\[0\]\.perspective\.yfov: must"):
        read_scene(with_camera(triangle, camera))


def test_orthographic_cameras_are_left_out_aloud(triangle):
    camera = {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 1}}
    scene = read_scene(with_camera(triangle, camera))
    assert scene.cameras == ()
    assert scene.warnings == ("1 orthographic camera is ignored; only perspective ones are used",)
