"""The robust error: its closed form, and that outliers do not dominate a fit."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import colored_room, room_view
from own_reference import own_reference
from point_vpls import point_vpls

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.tuner.fitting.fit_placement import fit_placement
from vpltune.tuner.fitting.fit_views import robust_errors
from vpltune.tuner.metrics.relative_squared_error import relative_weight
from vpltune.tuner.metrics.robust_error import LEAST_SCALE, MASKED_SHARE, RobustError, robust_error
from vpltune.tuner.surrogate.captured_view import CapturedView

PLANTED = point_vpls(intensity=0.8, falloff_footprint=0.7, vpl_count=256)


def counted(scale: float) -> RobustError:
    """The robust error of one pixel with irradiance 1 and weight 1, whose error is |y − 1|."""
    return RobustError(np.ones((1, 3)), np.ones((1, 3)), scale)


@pytest.mark.parametrize("error", [1e-3, 0.1, 1.0, 30.0])
def test_one_pixel_costs_pseudo_huber(error):
    """ρ(e) = 2s²(√(1 + (e/s)²) − 1) for s = 0.1, to 1e-9."""
    expected = 2.0 * 0.1**2 * (np.sqrt(1.0 + (error / 0.1) ** 2) - 1.0)
    assert counted(0.1).cost(np.full((1, 3), 1.0 + error)) == pytest.approx(expected, rel=1e-9)


def test_small_errors_count_squared_and_large_ones_linearly():
    """At a thousandth of the scale ρ is e² to 1e-6; at a thousand times the scale it is 2se to 1e-3."""
    assert counted(1.0).cost(np.full((1, 3), 1.001)) == pytest.approx(1e-6, rel=1e-6)
    assert counted(1e-3).cost(np.full((1, 3), 2.0)) == pytest.approx(2e-3, rel=1e-3)


@pytest.mark.parametrize("error", [0.01, 0.1, 1.0])
def test_a_weight_is_half_the_slope_over_the_error(error):
    """The weight equals ρ′(e)/(2e), by central differences with step 1e-5·e, to 1e-6. Reweighting needs this
    to reduce the cost."""
    step, pixel = 1e-5 * error, counted(0.1)
    ends = [pixel.cost(np.full((1, 3), 1.0 + error + sign * step)) for sign in (1.0, -1.0)]
    slope = (ends[0] - ends[1]) / (2.0 * step)
    weight = pixel.weights(np.full((1, 3), 1.0 + error))[0, 0] * 3.0
    assert weight == pytest.approx(slope / (2.0 * error), rel=1e-6)


def test_direct_light_masks_and_without_it_weights_are_those_of_relmse():
    """Without direct light both terms are that of relMSE. Strong direct light removes the second term."""
    random = np.random.default_rng(0)
    reference = random.uniform(0.5, 1.5, (64, 3))
    dark = robust_error(reference, np.zeros_like(reference), reference)
    assert np.allclose(dark.weight, relative_weight(reference) * reference.size, rtol=1e-12)
    lit = robust_error(reference, 1e3 * reference, reference)
    assert np.allclose(lit.weight, (1.0 - MASKED_SHARE) * dark.weight, rtol=1e-4)


def test_units_do_not_matter_and_a_black_view_says_nothing():
    """A thousand times as much light costs the same to 1e-9. A black view costs nothing."""
    random = np.random.default_rng(1)
    reference, direct, image = (random.uniform(0.1, 1.0, (64, 3)) for _ in range(3))
    small = robust_error(reference, direct, image)
    large = robust_error(1e3 * reference, 1e3 * direct, 1e3 * image)
    assert large.cost(1e3 * image) == pytest.approx(small.cost(image), rel=1e-9)
    black = robust_error(np.zeros((4, 3)), np.zeros((4, 3)), np.ones((4, 3)))
    assert black.cost(np.ones((4, 3))) == 0.0
    assert black.scale == LEAST_SCALE
    assert robust_error(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 3))).cost(np.zeros((0, 3))) == 0.0


def test_pixels_that_no_parameter_can_mend_do_not_rule_a_fit(gl_context):
    """One pixel in fifty is black in the reference, as if VPLs leaked through a wall.

    A fit of relMSE dims everything by more than 10 %. The robust fit dims by less than 6 % and by less than
    half of that. It does not reach 0: a black pixel has a hundred times the weight of others and still pulls
    ten times as hard.
    """
    runtime = Runtime(colored_room(), context=gl_context)
    planted = TunedConfig(PLANTED, visibility="transmittance", light=ONE_BOUNCE)
    view = room_view("spot")
    captured = runtime.capture(view, planted)
    reference = own_reference(captured)
    spoilt = reference.irradiance_a.copy()
    spoilt[np.random.default_rng(2).random(spoilt.shape[:2]) < 0.02] = 0.0
    reference = replace(reference, irradiance_a=spoilt, irradiance_b=spoilt)
    start = point_vpls(vpl_count=256)
    drawn = CapturedView(view, reference, runtime.capture(view, planted.with_parameters(start)))
    truth = captured.indirect_irradiance.mean(dtype=np.float64)
    fits = (fit_placement((drawn,), start, errors) for errors in (None, robust_errors((drawn,))))
    images = [
        runtime.render(view, planted.with_parameters(fit.parameters), layer="irradiance") for fit in fits
    ]
    dimmed, kept = (1.0 - image.mean(dtype=np.float64) / truth for image in images)
    assert dimmed > 0.1
    assert abs(kept) < min(0.06, 0.5 * dimmed)
