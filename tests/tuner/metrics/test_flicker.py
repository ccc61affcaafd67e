"""Flicker: how far each kind of light moves, and how the change of an image is measured."""

import math
from dataclasses import replace

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, room_view

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.evaluation.guard import judgement
from vpltune.tuner.metrics.flicker import TEXELS, flicker, moved_by_a_texel
from vpltune.tuner.metrics.view_metrics import ViewMetrics

START = ViewMetrics(0.02, 0.01, 0.5, 0.03, 0.99, 0.05, flicker=0.01)


@pytest.mark.parametrize("kind", ["spot", "directional"])
def test_a_light_turns_by_a_texel(kind):
    """It turns by the angle of a texel, and its direction keeps unit length."""
    before = ROOM_LIGHTS[kind]
    (after,) = moved_by_a_texel(room_view(kind), 1.0).lights
    angle = math.acos(float(before.direction_world @ after.direction_world))
    expected = 2.0 * before.outer_cone / TEXELS if kind == "spot" else 1.0 / TEXELS
    assert angle == pytest.approx(expected, rel=1e-4)
    assert np.linalg.norm(after.direction_world) == pytest.approx(1.0, abs=1e-12)


def test_a_point_light_is_shifted_in_the_scenes_own_units():
    (before,), (after,) = room_view("point").lights, moved_by_a_texel(room_view("point"), 100.0).lights
    shift = np.linalg.norm(after.position_world - before.position_world)
    assert shift == pytest.approx(100.0 * math.pi / 2.0 / TEXELS)


def test_flicker_is_the_mean_change_over_the_mean():
    before, valid = np.full((2, 2, 3), 2.0, np.float32), np.array([[True, True], [True, False]])
    after = before.copy()
    after[0, 0] = 2.3
    after[1, 1] = 99.0
    assert flicker(before, after, valid) == pytest.approx(0.3 / 3.0 / 2.0, rel=1e-5)
    assert flicker(0.0 * before, after, valid) == 0.0
    assert flicker(before, after, np.zeros((2, 2), bool)) == 0.0


def test_a_result_that_flickers_more_is_refused_and_unmeasured_flicker_does_not_count():
    """A result with half of every error but twice the flicker is rejected."""
    half = ViewMetrics(0.01, 0.005, 0.5, 0.015, 0.99, 0.025, flicker=0.02)
    found = judgement("tuned", ArtistParameters(), [START] * 3, [half] * 3)
    assert found.worse == ("flicker up to ×1.91",)
    silent = [replace(each, flicker=math.nan) for each in (START, half)]
    assert judgement("tuned", ArtistParameters(), silent[:1] * 3, silent[1:] * 3).accepted
