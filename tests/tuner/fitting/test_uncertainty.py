"""Intervals of fitted parameters: they keep their word, and say so where views do not tell."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from vpltune.cli.metrics_table import parameters_table
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.fitting.descent import profile
from vpltune.tuner.fitting.fit_views import fit_view
from vpltune.tuner.fitting.planted_problem import interval_coverage, planted_problem
from vpltune.tuner.fitting.uncertainty import fit_with_intervals
from vpltune.tuner.surrogate.tabulated_gather import gather_tabulated
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather

SIZE = (40, 30)
PRIOR = ArtistParameters()
TILES_APART = np.array([[1.02, 1.07], [0.93, 0.98]])
"""Factors of a view's tiles, right on average."""


def floor_view(height, planted, noise=0.0, misfit=None, seed=0, footprint=0.2):
    """A floor of 2 × 2 under nine VPLs at a height; `misfit` multiplies the image, tile by tile."""
    random = np.random.default_rng(seed)
    across, along = np.meshgrid(np.linspace(-1.0, 1.0, SIZE[0]), np.linspace(-1.0, 1.0, SIZE[1]))
    floor = np.stack([across.ravel(), along.ravel(), np.zeros(across.size)], axis=1)
    grid = np.stack(np.meshgrid([-0.6, 0.0, 0.6], [-0.6, 0.0, 0.6]), axis=-1).reshape(-1, 2)

    def array(values):
        return jnp.asarray(values, jnp.float32)

    receivers = Receivers(array(floor), array(np.tile([0.0, 0.0, 1.0], (len(floor), 1))))
    vpls = VirtualPointLights(
        array(np.concatenate([grid, np.full((9, 1), height)], axis=1)),
        array(np.tile([0.0, 0.0, -1.0], (9, 1))),
        array(np.full(9, footprint)),
        array(np.full((9, 3), 1.0 / 9.0)),
    )
    image = np.asarray(gather(receivers, vpls, FalloffParameters.of(planted)))
    if misfit is not None:
        tiles = np.repeat(np.repeat(misfit, SIZE[1] // 2, axis=0), SIZE[0] // 2, axis=1)
        image = image * tiles.reshape(-1, 1)
    halves = [
        (image * (1.0 + noise * random.standard_normal(image.shape))).astype(np.float32) for _ in range(2)
    ]
    return fit_view(receivers, vpls, None, *halves, np.arange(SIZE[0] * SIZE[1]), SIZE)


def test_a_clean_problem_has_narrow_intervals():
    """Noise of 2 % over 7,200 values: everything within 3 %, and the truth inside with room for the table."""
    planted = replace(PRIOR, intensity=1.3, falloff_footprint=1.2, extinction_coefficient=0.5)
    views = tuple(floor_view(height, planted, 0.02, seed=i) for i, height in enumerate((0.15, 0.4)))
    tuned, _, found = fit_with_intervals(views, PRIOR)
    for name, interval in found.items():
        assert interval.determined
        assert interval.low <= interval.value <= interval.high
        assert interval.value == getattr(tuned, name)
        assert interval.value == pytest.approx(getattr(planted, name), rel=0.03)
        assert interval.high - interval.low < 0.2 * interval.value


def test_what_the_views_leave_open_goes_to_the_prior():
    """VPLs far above the floor, each a hundredth as wide as it is far: no α can be told from another."""
    planted = replace(PRIOR, intensity=1.3, falloff_footprint=1.7)
    views = tuple(floor_view(2.0, planted, 0.03, TILES_APART, seed=i, footprint=0.02) for i in range(2))
    prior = replace(PRIOR, falloff_footprint=0.8)
    tuned, _, found = fit_with_intervals(views, prior)
    assert not found["falloff_footprint"].determined
    assert tuned.falloff_footprint == found["falloff_footprint"].value == 0.8
    assert found["falloff_footprint"].high > 5.0, found
    assert found["intensity"].determined
    assert found["intensity"].low < 1.3 < found["intensity"].high


def test_parameters_that_do_the_same_are_named():
    """At one and the same distance, the transmittance is but another intensity."""
    planted = replace(PRIOR, intensity=1.1, falloff_footprint=0.8, extinction_coefficient=0.4)
    views = tuple(floor_view(2.0, planted, 0.02, TILES_APART, seed=i, footprint=0.5) for i in range(2))
    _, _, found = fit_with_intervals(views, PRIOR)
    assert "extinction_coefficient" in found["intensity"].trades_with
    assert "intensity" in found["extinction_coefficient"].trades_with


def test_misfit_widens_the_intervals():
    """Tiles that disagree by 10 % leave k open by about as much, however little noise there is."""
    planted = replace(PRIOR, intensity=1.3, falloff_footprint=1.2, extinction_coefficient=0.5)
    misfit = np.array([[1.0, 1.2], [0.85, 1.05]])
    widths = []
    for field in (None, misfit):
        views = tuple(floor_view(height, planted, 0.01, field) for height in (0.15, 0.4))
        _, _, found = fit_with_intervals(views, PRIOR)
        widths.append(found["intensity"].high / found["intensity"].low)
    assert widths[0] < 1.1 < widths[1]


def test_a_tabulated_image_is_in_the_view():
    """The intervals' own image is the fit's: the same table, at the receivers themselves."""
    view = floor_view(0.4, PRIOR)
    image = np.asarray(gather_tabulated(view.table, FalloffParameters.of(PRIOR)))
    np.testing.assert_allclose(image, view.target.half_a, rtol=1e-2)
    assert sorted(set(np.asarray(view.tile).tolist())) == [0, 1, 2, 3]


def test_a_profile_is_a_parabola_where_the_loss_is_one():
    """Residuals (x − 0.3, y − 0.6 + x/2): with x held, y makes up for it; with y held as well, it cannot."""

    def residuals(point, _):
        return jnp.stack([point[0] - 0.3, point[1] - 0.6 + point[0] / 2.0])

    start, places = np.array([0.3, 0.45]), np.linspace(0.0, 1.0, 5)
    free = np.array([True, True])
    np.testing.assert_allclose(
        profile(residuals, None, start, 0, places, free), (places - 0.3) ** 2, atol=1e-6
    )
    held = profile(residuals, None, start, 0, places, ~free)
    np.testing.assert_allclose(held, 1.25 * (places - 0.3) ** 2, atol=1e-6)


def test_the_table_tells_what_is_open():
    from rich.console import Console

    interval = {"low": 0.05, "high": 20.0, "determined": False, "trades_with": ("intensity",)}
    console = Console(width=160)
    with console.capture() as shown:
        console.print(parameters_table(PRIOR.as_dict(), {"falloff_footprint": interval}))
    lines = shown.get().splitlines()
    (row,) = (row for row, line in enumerate(lines) if "falloff_footprint" in line)
    assert "0.05 to 20" in lines[row]
    assert "not determined" in lines[row + 1]
    assert "trades with k" in lines[row + 2]


def test_planted_problems_are_seeded():
    first, again, other = (planted_problem(seed) for seed in (3, 3, 4))
    assert first.planted == again.planted != other.planted
    np.testing.assert_array_equal(first.views[0].target.half_a, again.views[0].target.half_a)


@pytest.mark.slow
def test_intervals_hold_the_truth():
    """50 planted problems: between 80 and 97 % of the 90 % intervals hold what was planted."""
    assert 0.80 <= interval_coverage(50).contains.mean() <= 0.97
