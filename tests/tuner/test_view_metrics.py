"""Figures of a picture: relative ones have no value where nothing is there to be relative to."""

import math

import numpy as np
import pytest

from tuner.view_metrics import ViewMetrics, energy_ratio, mean_metrics, relmse

GREY, BLACK = np.full((4, 3), 0.5, np.float32), np.zeros((4, 3), np.float32)


def test_of_a_grey_picture():
    """Half as bright: (0.5 − 0.25)² / (0.5² + 0.01·0.5²) = 0.25/1.01."""
    assert relmse(0.5 * GREY, GREY) == pytest.approx(0.25 / 1.01)
    assert energy_ratio(0.5 * GREY, GREY) == pytest.approx(0.5)


@pytest.mark.parametrize("picture", [GREY, BLACK])
def test_against_a_black_reference_there_is_no_value(picture):
    assert math.isnan(relmse(picture, BLACK))
    assert math.isnan(energy_ratio(picture, BLACK))


def test_the_mean_is_over_views_that_have_a_value():
    unlit, lit = ViewMetrics(math.nan, math.nan, 0.5), ViewMetrics(0.25, 1.5, 0.25)
    assert mean_metrics([unlit, lit]) == ViewMetrics(0.25, 1.5, 0.375)
    assert math.isnan(mean_metrics([unlit, unlit]).relmse)
