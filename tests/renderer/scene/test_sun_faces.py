"""A sun's faces: each of whole texels of the one around it, about the eye, at every scale."""

from itertools import pairwise

import numpy as np
import pytest
from built_scenes import colored_room
from hypothesis import given
from hypothesis import strategies as st
from room_on_ground import room_on_ground

from vpltune.renderer.scene.scene import scaled
from vpltune.renderer.scene.sun_faces import MOST_NESTED_FACES, SunGrid, nested_face_count, sun_faces

BOUNDS = np.array([[-100.0, 0.0, -50.0], [100.0, 3.0, 50.0]])
CELLS = 256


def faces(eye, direction=(0.48, 0.6, 0.64), nested=2, scale=1.0):
    """Faces of a sun that stands in `direction`, the last column of a rotation."""
    back = np.array(direction)
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(back, right), back], axis=1)
    x, y, z = (scale * np.array(eye)).tolist()
    return rotation, sun_faces(rotation, scale * BOUNDS, SunGrid(CELLS, (x, y, z), nested))


@given(st.tuples(st.floats(-120.0, 120.0), st.floats(-5.0, 20.0), st.floats(-60.0, 60.0)))
def test_a_finer_face_is_whole_texels_of_the_one_around_it(eye):
    """To 1e-6 texel: no texel lies astride a border, so none is counted twice or lost."""
    _, made = faces(eye, nested=3)
    assert len(made) == 4
    for outer, finer in pairwise(made):
        texel = 2.0 * outer.extent / CELLS
        for corner in (finer.center - finer.extent, finer.center + finer.extent):
            place = (corner - (outer.center - outer.extent)) / texel
            np.testing.assert_allclose(place, np.round(place), atol=1e-6)
            assert (place > -1e-6).all() and (place < CELLS + 1e-6).all()
        assert (finer.front, finer.depth) == (outer.front, outer.depth)


def test_finer_faces_lie_around_the_eye():
    """Within half a texel of the face around them, and eight times as fine along the wider axis."""
    rotation, made = faces((20.0, 1.5, -10.0))
    assert len(made) == 3
    eye = (np.array([20.0, 1.5, -10.0]) @ rotation)[:2]
    for outer, finer in pairwise(made):
        assert (np.abs(finer.center - eye) <= outer.extent / CELLS * 1.001).all()
        assert finer.extent.max() == pytest.approx(outer.extent.max() / 8.0, rel=0.02)


def test_faces_stand_still_while_the_eye_moves_within_a_texel():
    """A thousand steps along a metre move the finest face only as often as it passes a texel around it.

    It does follow: across the sun's direction, the metre is 0.88 m long.
    """
    steps = np.linspace(0.0, 1.0, 1001)
    places = [faces((20.0 + step, 1.5, -10.0))[1][-1].center for step in steps]
    texel = 2.0 * faces((20.0, 1.5, -10.0))[1][1].extent[0] / CELLS
    assert 0.88 / texel <= len(np.unique(np.round(places, 9), axis=0)) <= 2.0 * (1.0 / texel + 1.0) + 1.0


@pytest.mark.parametrize("scale", [0.01, 100.0])
def test_faces_scale_with_the_scene(scale):
    for own, other in zip(faces((3.0, 1.0, 2.0))[1], faces((3.0, 1.0, 2.0), scale=scale)[1], strict=True):
        np.testing.assert_allclose(other.center, scale * own.center, rtol=1e-9, atol=1e-9 * scale)
        np.testing.assert_allclose(other.extent, scale * own.extent, rtol=1e-9)


def test_only_scenes_that_are_large_for_their_parts_have_finer_faces():
    assert nested_face_count(colored_room()) == 0
    counts = [nested_face_count(room_on_ground(width)) for width in (20.0, 200.0, 2e3, 1e4, 1e6)]
    assert counts == [0, 1, 2, 3, MOST_NESTED_FACES]


@pytest.mark.parametrize("scale", [0.01, 100.0])
def test_their_number_does_not_depend_on_scale(scale):
    scene = room_on_ground(300.0)
    assert nested_face_count(scaled(scene, scale)) == nested_face_count(scene)
