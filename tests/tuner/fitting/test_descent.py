"""Least squares in the unit cube: known minima, bounds, and places where the residuals are not numbers."""

import jax.numpy as jnp
import numpy as np
import pytest

from vpltune.tuner.fitting.descent import descend
from vpltune.tuner.fitting.fit_status import FitStatus

AIM = np.array([0.3, 0.6, 0.5], np.float32)


def towards(point, aim):
    return point - aim


def valley(point, _):
    """Rosenbrock's, its minimum at (0.75, 0.75) of the cube: curved, narrow, and slow for plain gradients."""
    x, y = 4.0 * point - 2.0
    return jnp.stack([10.0 * (y - x * x), 1.0 - x])


def broken_beyond_the_middle(point, aim):
    return jnp.where(point[0] < 0.5, point - aim, jnp.nan)


def test_a_linear_problem_is_solved():
    result = descend(towards, AIM, np.zeros(3))
    np.testing.assert_allclose(result.point, AIM, atol=1e-5)
    assert result.status is FitStatus.CONVERGED
    assert result.loss < 1e-9
    assert result.start_loss == pytest.approx(float((AIM**2).sum()))


def test_a_minimum_outside_is_met_at_the_wall():
    """The nearest point of the cube to (1.5, −0.2, 0.5): projections may not stall on the way there."""
    result = descend(towards, np.array([1.5, -0.2, 0.5], np.float32), np.full(3, 0.5))
    np.testing.assert_allclose(result.point, [1.0, 0.0, 0.5], atol=1e-5)


@pytest.mark.parametrize("seed", range(8))
def test_a_curved_valley(seed):
    result = descend(valley, None, np.random.default_rng(seed).random(2), steps=80)
    np.testing.assert_allclose(result.point, [0.75, 0.75], atol=2e-3)


def test_the_offset_is_part_of_the_loss_alone():
    plain, shifted = (descend(towards, AIM, np.zeros(3), offset=offset) for offset in (0.0, -2.0))
    np.testing.assert_array_equal(plain.point, shifted.point)
    np.testing.assert_allclose(shifted.losses, plain.losses - 2.0)


def test_losses_never_rise():
    result = descend(valley, None, np.array([0.1, 0.9]), steps=80)
    assert (np.diff(result.losses) <= 0.0).all()


def test_steps_into_what_is_not_a_number_are_taken_back():
    result = descend(broken_beyond_the_middle, np.array([0.9, 0.2, 0.2], np.float32), np.full(3, 0.1))
    assert np.isfinite(result.loss)
    assert result.loss < result.start_loss
    assert 0.3 < result.point[0] < 0.5


def test_a_start_that_is_not_a_number_is_a_status():
    start = np.full(3, 0.9)
    result = descend(broken_beyond_the_middle, AIM, start)
    assert result.status is FitStatus.NOT_FINITE
    np.testing.assert_allclose(result.point, start)


def test_a_start_that_cannot_be_bettered_is_a_status():
    result = descend(towards, AIM, AIM.astype(np.float64))
    assert result.status is FitStatus.NO_IMPROVEMENT
    np.testing.assert_array_equal(result.point, AIM)


def test_an_axis_that_does_nothing_stays():
    result = descend(lambda point, aim: (point - aim)[:2], AIM, np.array([0.9, 0.9, 0.123]))
    np.testing.assert_allclose(result.point, [*AIM[:2], 0.123], atol=1e-5)
