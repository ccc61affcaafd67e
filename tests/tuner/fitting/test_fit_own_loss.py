"""A loss of one's own: the minimum of least squares where both are the same, and planted parameters."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from corner import corner

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.errors import InputError
from vpltune.tuner.fitting.fit_falloff import fit_to
from vpltune.tuner.fitting.fit_own_loss import _SPACE, _value_and_gradient, loss_name, minimise_loss
from vpltune.tuner.fitting.fit_status import FitStatus
from vpltune.tuner.fitting.fit_views import fit_view_of_table
from vpltune.tuner.fitting.planted_problem import SIZE, planted_problem
from vpltune.tuner.metrics.relative_squared_error import DARK_SHARE, target_of
from vpltune.tuner.surrogate.tabulated_gather import tabulate_gather
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather

PLANTED = ArtistParameters(intensity=1.3, falloff_footprint=0.7, extinction_coefficient=0.6)


def relative_squares(predicted, reference):
    """relMSE, which a least-squares fit minimises too."""
    dark = DARK_SHARE * jnp.mean(reference) ** 2
    return jnp.mean((predicted - reference) ** 2 / (reference**2 + dark))


def log_ratio(predicted, reference):
    """Mean square of the logarithm's error: no sum of squares of the image's."""
    return jnp.mean((jnp.log(predicted + 1e-4) - jnp.log(reference + 1e-4)) ** 2)


def absolute(predicted, reference):
    """Not smooth: its gradient jumps wherever a value passes its reference."""
    return jnp.mean(jnp.abs(predicted - reference))


@pytest.fixture(scope="module")
def lit_floor():
    """A floor's table, and its exact image at the planted parameters."""
    receivers, vpls = corner(np.random.default_rng(2), 400, 40)
    return ((tabulate_gather(receivers, vpls), gather(receivers, vpls, FalloffParameters.of(PLANTED))),)


def as_own_and_as_squares(seed):
    """A planted problem with one mean reference: for a loss of one's own, and for least squares."""
    own, squares = [], []
    for view in planted_problem(seed).views:
        mean = np.asarray((view.target.half_a + view.target.half_b) / 2.0)
        own.append((view.table, jnp.asarray(mean)))
        pixels = np.arange(SIZE[0] * SIZE[1])
        squares.append(fit_view_of_table(view.table, target_of(mean, mean), pixels, SIZE))
    return own, tuple(squares)


@pytest.mark.parametrize("seed", [4, 5, 6, 9])
def test_relative_squares_have_the_minimum_of_least_squares(seed):
    """Both find the same minimum: the loss to 2e-4, and the point to 0.1 % of the cube's side.

    Least squares run in single precision on the reduced problem, whose factorisation rounds to about 1e-4 of
    these losses. The seeds are those whose minimum lies inside the cube and not in a flat valley.
    """
    own, squares = as_own_and_as_squares(seed)
    expected, descent = fit_to(squares, ArtistParameters())
    tuned, found = minimise_loss(own, ArtistParameters(), relative_squares)
    assert found.loss == pytest.approx(descent.loss, rel=2e-4)
    np.testing.assert_allclose(_SPACE.point(tuned), _SPACE.point(expected), atol=1e-3)
    assert found.status is FitStatus.CONVERGED
    assert found.losses[-1] == pytest.approx(found.loss)


@pytest.mark.parametrize("seed", range(4))
def test_it_never_ends_above_least_squares(seed):
    """Least squares know one descent; this one starts at several places of α. Tolerance as above."""
    own, squares = as_own_and_as_squares(seed)
    _, descent = fit_to(squares, ArtistParameters())
    _, found = minimise_loss(own, ArtistParameters(), relative_squares)
    assert found.loss <= (1.0 + 2e-4) * descent.loss


@pytest.mark.parametrize("loss", [relative_squares, log_ratio, absolute], ids=loss_name)
@pytest.mark.parametrize("seed", range(3))
def test_planted_parameters_are_found_from_a_random_start(lit_floor, loss, seed):
    """k, α and κ to 1 %, as for least squares: most of the error is that of the table."""
    start = _SPACE.parameters(np.random.default_rng(seed).random(3), PLANTED)
    tuned, found = minimise_loss(lit_floor, start, loss)
    assert found.loss < found.start_loss
    for name in _SPACE.names:
        assert getattr(tuned, name) == pytest.approx(getattr(PLANTED, name), rel=1e-2), name


@pytest.mark.parametrize("loss", [relative_squares, log_ratio], ids=loss_name)
def test_the_gradient_is_that_of_finite_differences(lit_floor, loss):
    """Central differences with a step of 1e-5 in double precision err by 1e-8 or so; 1e-5 of the largest."""
    with jax.enable_x64(True):
        point = np.array([0.6, 0.4, 0.3])
        _, gradient = _value_and_gradient(loss, jnp.asarray(point), lit_floor)
        ends = [
            [
                float(_value_and_gradient(loss, jnp.asarray(point + sign * 1e-5 * axis), lit_floor)[0])
                for sign in (-1.0, 1.0)
            ]
            for axis in np.eye(3)
        ]
    finite = np.diff(ends, axis=1)[:, 0] / 2e-5
    np.testing.assert_allclose(gradient, finite, atol=1e-5 * np.abs(finite).max())


def test_a_minimum_beyond_a_bound_is_met_at_the_bound(lit_floor):
    """The brightest image: the largest k, no extinction, and the sharpest falloff."""
    tuned, found = minimise_loss(lit_floor, PLANTED, lambda predicted, reference: -jnp.mean(predicted))
    assert found.loss < 0.0
    assert tuned.intensity == _SPACE.specs[_SPACE.names.index("intensity")].high
    assert tuned.extinction_coefficient == 0.0


def test_a_start_that_cannot_be_bettered_is_kept(lit_floor):
    start = ArtistParameters()
    tuned, found = minimise_loss(lit_floor, start, lambda predicted, reference: 0.0 * jnp.sum(predicted))
    assert tuned == start
    assert found.status is FitStatus.NO_IMPROVEMENT


WRONG = {
    "got nan at intensity 1, falloff_footprint 1, extinction_coefficient 0": lambda predicted, reference: (
        jnp.sum(predicted) * jnp.nan
    ),
    "got inf at intensity 1": lambda predicted, reference: jnp.sum(predicted) / 0.0,
    # d√x/dx is infinite at 0.
    "got a gradient of": lambda predicted, reference: jnp.sqrt(0.0 * jnp.sum(predicted)),
    r"must return one real number, got float32 of shape \[400, 3\]": lambda predicted, reference: predicted,
    "must return one real number, got int32": lambda predicted, reference: jnp.argmax(predicted),
    "must return one real number, got NoneType": lambda predicted, reference: None,
    "must be written with jax.numpy": lambda predicted, reference: np.asarray(predicted).mean(),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_no_loss_is_one_line(lit_floor, message):
    with pytest.raises(InputError, match=f"^loss: .*{message}") as caught:
        minimise_loss(lit_floor, ArtistParameters(), WRONG[message])
    assert "\n" not in str(caught.value)
