"""Metrics of a view in closed form. Relative metrics are NaN against a black reference."""

import math
from dataclasses import replace

import numpy as np
import pytest
from built_scenes import colored_room, room_view
from own_reference import own_reference

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.tuner.metrics.view_metrics import (
    ViewMetrics,
    energy_ratio,
    mean_metrics,
    median_error,
    relmse,
    trimmed_relmse,
)
from vpltune.tuner.surrogate.captured_view import CapturedView

GREY, BLACK = np.full((4, 3), 0.5, np.float32), np.zeros((4, 3), np.float32)


def test_of_a_grey_image():
    """The image is half as bright: (0.5 − 0.25)² / (0.5² + 0.01·0.5²) = 0.25/1.01."""
    assert relmse(0.5 * GREY, GREY) == pytest.approx(0.25 / 1.01)
    assert energy_ratio(0.5 * GREY, GREY) == pytest.approx(0.5)
    assert median_error(0.5 * GREY, GREY) == pytest.approx(0.5)


@pytest.mark.parametrize("image", [GREY, BLACK])
def test_against_a_black_reference_there_is_no_value(image):
    assert math.isnan(relmse(image, BLACK))
    assert math.isnan(energy_ratio(image, BLACK))
    assert math.isnan(median_error(image, BLACK))
    assert all(math.isnan(value) for value in trimmed_relmse(image, BLACK))


def test_without_the_worst_pixel_in_a_thousand():
    """Two of 2,000 pixels are off by a factor of 11, the others by 1 %: the two cause 99.9 % of relMSE."""
    reference = np.ones((2000, 3), np.float32)
    image = 1.01 * reference
    image[[7, 1234]] = 11.0
    trimmed, share = trimmed_relmse(image, reference)
    assert trimmed == pytest.approx(1e-4 / 1.01, rel=1e-3)
    assert share == pytest.approx(1.0 - 1998 * 1e-4 / (1998 * 1e-4 + 200.0), rel=1e-6)
    assert median_error(image, reference) == pytest.approx(0.01, rel=1e-3)


def test_a_pixel_alone_is_kept_and_no_error_has_no_worst():
    assert trimmed_relmse(2.0 * GREY[:1], GREY[:1])[0] == relmse(2.0 * GREY[:1], GREY[:1])
    assert trimmed_relmse(GREY, GREY) == (0.0, 0.0)


def test_the_mean_is_over_views_that_have_a_value():
    unlit = ViewMetrics(math.nan, math.nan, math.nan, math.nan, math.nan, 0.5)
    lit = ViewMetrics(0.25, 0.125, 0.5, 0.1, 1.5, 0.25)
    assert mean_metrics([unlit, lit]) == ViewMetrics(0.25, 0.125, 0.5, 0.1, 1.5, 0.375)
    assert math.isnan(mean_metrics([unlit, unlit]).relmse)


def test_flip_compares_light_and_not_textures(gl_context):
    """FLIP is 0 if the light is the same and only the reference's albedo differs, as by texture filtering."""
    runtime = Runtime(colored_room(), context=gl_context)
    view = room_view("spot")
    captured = runtime.capture(view, TunedConfig(quality=Quality(rsm_resolution=128), light=ONE_BOUNCE))
    noise = np.random.default_rng(0).uniform(0.2, 1.0, captured.albedo.shape).astype(np.float32)
    seen = CapturedView(view, replace(own_reference(captured), albedo=noise), captured)
    assert seen.metrics(captured.indirect_irradiance).flip < 1e-6
    assert seen.metrics(0.5 * captured.indirect_irradiance).flip > 0.01
