"""Baked environments keep their mean, and bright texels land where the turn takes them."""

import math

import numpy as np
import pytest

from vpltune.renderer.scene.environment import Environment, solid_angles, texel_directions
from vpltune.renderer.scene.environment_baking import MOST_COLUMNS, MOST_ROWS, baked_environment


def planes(radiance):
    return [np.ascontiguousarray(radiance[..., channel]) for channel in range(3)]


def rotation(axis, degrees):
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = math.radians(degrees)
    return np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross


def sunny(height, width):
    """A dim sky with some texels ten thousand times as bright."""
    radiance = np.random.default_rng(3).uniform(0.0, 1.0, (height, width, 3)).astype(np.float32)
    radiance[height // 3, width // 5] = (2e4, 1e4, 5e3)
    radiance[0, 0] = 1e3
    return radiance


TURNS = {
    "none": None,
    "half": rotation((0, 1, 0), 180.0),
    "about y": rotation((0, 1, 0), 37.3),
    "upright": rotation((1, 0, 0), 90.0),
    "any": rotation((1, -2, 0.5), 123.0),
    "mirrored": rotation((1, -2, 0.5), 123.0) @ np.diag([1.0, 1.0, -1.0]),
}


@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS.keys())
@pytest.mark.parametrize("size", [(1, 1), (3, 7), (64, 128), (600, 1300)])
def test_the_mean_is_kept(size, turn):
    radiance = sunny(*size)
    baked = baked_environment(planes(radiance), turn)
    assert baked.radiance.shape[0] <= MOST_ROWS
    assert baked.radiance.shape[1] <= MOST_COLUMNS
    assert (baked.radiance >= 0.0).all()
    assert np.isfinite(baked.radiance).all()
    np.testing.assert_allclose(
        baked.mean_radiance(), Environment(radiance).mean_radiance(), rtol=1e-3 if turn is not None else 1e-5
    )


@pytest.mark.parametrize("turn", TURNS.values(), ids=TURNS.keys())
def test_a_bright_texel_lands_where_it_is_turned(turn):
    """The light vector of the whole map is turned like the texel, within a texel's width."""
    radiance = np.zeros((64, 128, 3), np.float32)
    radiance[20, 100] = 5.0
    towards = texel_directions(64, 128)[20, 100]
    expected = towards if turn is None else turn @ towards
    baked = baked_environment(planes(radiance), turn).radiance
    height, width, _ = baked.shape
    weights = baked[..., 0] * solid_angles(height, width)[:, None]
    found = np.einsum("hw,hwd->d", weights, texel_directions(height, width))
    found /= np.linalg.norm(found)
    assert math.degrees(math.acos(min(1.0, found @ expected))) < 0.5 * 180.0 / 64


def test_a_map_that_is_small_and_straight_keeps_its_texels():
    radiance = sunny(16, 32)
    np.testing.assert_array_equal(baked_environment(planes(radiance)).radiance, radiance)
    turned = baked_environment(planes(radiance), rotation((0, 1, 0), 90.0)).radiance
    # A quarter turn about +Y takes −Z to −X: from azimuth 0 to −90°.
    np.testing.assert_array_equal(turned, np.roll(radiance, -8, axis=1))


def test_boxes_are_weighted_by_solid_angle():
    radiance = np.zeros((1024, 4, 3), np.float32)
    radiance[0] = 1.0
    baked = baked_environment(planes(radiance)).radiance
    share = (1.0 - math.cos(math.pi / 1024)) / (1.0 - math.cos(math.pi / 512))
    np.testing.assert_allclose(baked[0], share, rtol=1e-6)
    assert not baked[1:].any()


def test_an_even_sky_stays_even():
    even = np.full((40, 80, 3), 2.5, np.float32)
    np.testing.assert_allclose(baked_environment(planes(even), TURNS["any"]).radiance, 2.5, rtol=1e-6)
