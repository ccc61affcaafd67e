"""Camera and light from flags: what they mean, and which go together."""

import math

import numpy as np
import pytest

from vpltune.cli.options import parse_numbers, parse_size
from vpltune.cli.view_flags import ViewFlags, camera_from_flags, light_from_flags
from vpltune.renderer.errors import InputError

SPOT = {"light_type": "spot", "light_position": "0,2,0"}
POINT = {"light_type": "point", "light_position": "0,2,0"}
SUN = {"light_type": "directional", "light_direction": "0,-2,0"}


def test_no_flags_are_no_override():
    assert camera_from_flags(ViewFlags()) is None
    assert light_from_flags(ViewFlags()) is None


def test_a_camera_looks_where_it_is_told():
    camera = camera_from_flags(ViewFlags(eye="1,2,3", look_at="1,2,-7", yfov=40.0))
    np.testing.assert_allclose(camera.position_world, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(-camera.to_world[:3, 2], [0.0, 0.0, -1.0], atol=1e-15)
    assert camera.yfov == pytest.approx(math.radians(40.0))


def test_a_camera_without_angle_has_fifty_degrees():
    camera = camera_from_flags(ViewFlags(eye="0,0,1", look_at="0,0,0"))
    assert camera.yfov == pytest.approx(math.radians(50.0))


def test_a_spot_light_by_target_and_by_direction_is_the_same():
    by_target = light_from_flags(ViewFlags(**SPOT, light_look_at="0,-1,4", light_cone="10,30"))
    by_direction = light_from_flags(ViewFlags(**SPOT, light_direction="0,-3,4", light_cone="10,30"))
    np.testing.assert_allclose(by_target.direction_world, [0.0, -0.6, 0.8], atol=1e-15)
    np.testing.assert_allclose(by_direction.direction_world, by_target.direction_world, atol=1e-15)
    assert by_target.kind == "spot"
    assert by_target.inner_cone == pytest.approx(math.radians(10.0))
    assert by_target.outer_cone == pytest.approx(math.radians(30.0))


def test_a_spot_light_without_cone_has_that_of_gltf():
    light = light_from_flags(ViewFlags(**SPOT, light_direction="0,-1,0"))
    assert (light.inner_cone, light.outer_cone) == (0.0, pytest.approx(math.pi / 4))


def test_a_cone_of_equal_angles_is_a_hard_edge():
    light = light_from_flags(ViewFlags(**SPOT, light_direction="0,-1,0", light_cone="30,30"))
    assert light.outer_cone == pytest.approx(math.radians(30.0))
    # The falloff is a thousandth of the half angle: what the renderer needs to divide by.
    assert 0.0 < light.outer_cone - light.inner_cone < 0.002 * light.outer_cone


@pytest.mark.parametrize("light", [POINT, SPOT | {"light_direction": "0,-1,0"}])
def test_a_light_ends_at_its_range(light):
    assert light_from_flags(ViewFlags(**light)).range == math.inf
    assert light_from_flags(ViewFlags(**light, light_range=2.5)).range == 2.5
    assert light_from_flags(ViewFlags(**light, light_range=1e300)).range == math.inf


def test_one_intensity_is_white_and_three_are_a_colour():
    np.testing.assert_array_equal(light_from_flags(ViewFlags(**POINT)).intensity, [1.0, 1.0, 1.0])
    one = light_from_flags(ViewFlags(**POINT, light_intensity="7"))
    np.testing.assert_array_equal(one.intensity, [7.0, 7.0, 7.0])
    three = light_from_flags(ViewFlags(**POINT, light_intensity="1,0,2"))
    np.testing.assert_array_equal(three.intensity, [1.0, 0.0, 2.0])


def test_a_directional_light_by_direction_and_by_two_points():
    np.testing.assert_allclose(light_from_flags(ViewFlags(**SUN)).direction_world, [0.0, -1.0, 0.0])
    light = light_from_flags(
        ViewFlags(light_type="directional", light_position="5,5,0", light_look_at="5,0,0")
    )
    np.testing.assert_allclose(light.direction_world, [0.0, -1.0, 0.0])


REFUSED_CAMERAS = {
    "eye alone": ({"eye": "0,0,0"}, "a camera needs both"),
    "target alone": ({"look_at": "0,0,0"}, "a camera needs both"),
    "angle alone": ({"yfov": 40.0}, "a camera needs both"),
    "same point": ({"eye": "1,1,1", "look_at": "1,1,1"}, "--look-at: must differ from --eye, got 1,1,1"),
    "two numbers": ({"eye": "1,1", "look_at": "0,0,0"}, "--eye: must be 3 finite numbers .* got '1,1'"),
    "NaN": ({"eye": "nan,1,1", "look_at": "0,0,0"}, "--eye: must be 3 finite numbers"),
    "infinity": ({"eye": "1,1,1e999", "look_at": "0,0,0"}, "--eye: must be 3 finite numbers"),
    "word": ({"eye": "here", "look_at": "0,0,0"}, "--eye: must be 3 finite numbers .* got 'here'"),
    "wide": ({"eye": "0,0,1", "look_at": "0,0,0", "yfov": 180.0}, "--yfov: must be from 1 to 170 degrees"),
    "angle NaN": ({"eye": "0,0,1", "look_at": "0,0,0", "yfov": math.nan}, "--yfov: must be from 1 to 170"),
}


@pytest.mark.parametrize(("flags", "message"), REFUSED_CAMERAS.values(), ids=REFUSED_CAMERAS)
def test_cameras_that_cannot_be_are_refused(flags, message):
    with pytest.raises(InputError, match=message):
        camera_from_flags(ViewFlags(**flags))


REFUSED_LIGHTS = {
    "no type": ({"light_intensity": "3"}, "--light-type: must be given with --light-intensity"),
    "point without place": ({"light_type": "point"}, "--light-position: must be given for a point"),
    "point with direction": (
        POINT | {"light_direction": "0,1,0"},
        "--light-direction: a point light has none",
    ),
    "point with target": (POINT | {"light_look_at": "0,1,0"}, "--light-look-at: a point light has none"),
    "point with cone": (POINT | {"light_cone": "1,2"}, "--light-cone: a point light has none"),
    "spot without place": ({"light_type": "spot", "light_direction": "0,1,0"}, "given for a spot light"),
    "spot without aim": (SPOT, "--light-direction: a spot light needs either this or --light-look-at"),
    "spot aimed twice": (SPOT | {"light_direction": "0,1,0", "light_look_at": "0,0,0"}, "not both"),
    "spot at itself": (SPOT | {"light_look_at": "0,2,0"}, "--light-look-at: must give the light a direction"),
    "no direction": (SPOT | {"light_direction": "0,0,0"}, "--light-direction: must give the light"),
    "cone inside out": (
        SPOT | {"light_direction": "0,1,0", "light_cone": "30,10"},
        "0 ≤ inner ≤ outer ≤ 90 degrees and outer > 0, got 30 and 10",
    ),
    "cone too wide": (
        SPOT | {"light_direction": "0,1,0", "light_cone": "30,91"},
        "0 ≤ inner ≤ outer ≤ 90 degrees and outer > 0, got 30 and 91",
    ),
    "cone of one": (
        SPOT | {"light_direction": "0,1,0", "light_cone": "30"},
        "--light-cone: must be 2 finite",
    ),
    "sun with cone": (SUN | {"light_cone": "1,2"}, "--light-cone: a directional light has none"),
    "sun with range": (SUN | {"light_range": 3.0}, "--light-range: a directional light has none"),
    "range alone": ({"light_range": 3.0}, "--light-type: must be given with --light-range"),
    "range of 0": (POINT | {"light_range": 0.0}, "--light-range: must be positive, at least 1e-30, got 0"),
    "range of NaN": (POINT | {"light_range": math.nan}, "--light-range: must be positive"),
    "sun with place": (SUN | {"light_position": "1,2,3"}, "takes it only with --light-look-at"),
    "sun without aim": ({"light_type": "directional"}, "a directional light needs either this or"),
    "dark": (POINT | {"light_intensity": "0"}, "--light-intensity: must not be negative or all zero, got 0"),
    "negative": (POINT | {"light_intensity": "1,-1,1"}, "--light-intensity: must not be negative"),
    "two colours": (POINT | {"light_intensity": "1,2"}, "--light-intensity: must be 1 or 3 finite numbers"),
}


@pytest.mark.parametrize(("flags", "message"), REFUSED_LIGHTS.values(), ids=REFUSED_LIGHTS)
def test_lights_that_cannot_be_are_refused(flags, message):
    with pytest.raises(InputError, match=message):
        light_from_flags(ViewFlags(**flags))


def test_numbers_and_sizes_are_read():
    assert parse_numbers("-1, 2.5,1e3", "--eye", (3,)) == [-1.0, 2.5, 1000.0]
    assert parse_size("640x480") == (640, 480)
    assert parse_size("1X16384") == (1, 16384)
    for bad in ("640", "x", "640x", "640x480x3", "640 x 480", "٣x٣", "1e3x2", "9999999x1"):
        with pytest.raises(InputError, match="--size: must be WxH"):
            parse_size(bad)
