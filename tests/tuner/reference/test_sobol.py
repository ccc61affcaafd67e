"""The points are Sobol' points, and scrambling keeps them even and makes them unbiased."""

import numpy as np
import pytest
from scipy.stats import qmc

from vpltune.tuner.reference.directions import cone_direction, cosine_direction, disc_point
from vpltune.tuner.reference.sobol import hashed, owen_scrambled, reversed_sobol_points


@pytest.fixture
def numpy_arrays(monkeypatch):
    """The arithmetic of `NumpyWavefront`, without a scene."""
    pytest.importorskip("mitsuba").set_variant("scalar_rgb")
    from vpltune.tuner.reference.numpy_wavefront import NumpyWavefront

    yield object.__new__(NumpyWavefront)
    from vpltune.tuner.reference.variant import select_variant

    select_variant()


def bits_reversed(values: np.ndarray) -> np.ndarray:
    return np.array([int(f"{value:032b}"[::-1], 2) for value in values], np.uint64)


def test_points_are_sobol_s():
    ours = bits_reversed(reversed_sobol_points(0, 256).ravel()).reshape(-1, 2) / 2.0**32
    with_scipy = qmc.Sobol(2, scramble=False).random(256)
    # SciPy returns the same points in Gray-code order.
    assert {tuple(p) for p in ours} == {tuple(p) for p in with_scipy}
    assert np.array_equal(reversed_sobol_points(100, 50), reversed_sobol_points(0, 150)[100:])


@pytest.mark.parametrize("seed", [0, 1, 0xDEADBEEF])
def test_scrambled_points_fill_every_cell_of_every_elementary_grid(numpy_arrays, seed):
    """They remain a (0, 8, 2)-net: each dyadic box of area 2⁻⁸ holds one of the 256 points."""
    points = reversed_sobol_points(0, 256)
    x, y = (
        owen_scrambled(numpy_arrays, points[:, k], np.array([seed + 77 * k], np.uint32)) for k in range(2)
    )
    assert min(x.min(), y.min()) >= 0.0 and max(x.max(), y.max()) < 1.0
    for split in range(9):
        cell = np.floor(x * 2**split) + np.floor(y * 2 ** (8 - split)) * 2**split
        assert len(np.unique(cell)) == 256


def test_one_point_is_uniform_over_seeds(numpy_arrays):
    """Over many seeds, each single point is uniform in [0, 1)."""
    seeds = np.random.default_rng(0).integers(0, 2**32, 40000, dtype=np.uint32)
    for index in (0, 1, 37):
        values = owen_scrambled(numpy_arrays, np.array([index], np.uint32), seeds)
        counts, _ = np.histogram(values, 16, (0.0, 1.0))
        # χ² with 15 degrees of freedom exceeds 37.7 once in a thousand.
        assert np.sum((counts - 2500.0) ** 2 / 2500.0) < 37.7
    assert (
        np.abs(np.corrcoef(hashed(numpy_arrays, np.arange(40000, dtype=np.uint32), seeds), values)[0, 1])
        < 0.02
    )


@pytest.mark.parametrize("axis", [[0, 0, 1], [0, 0, -1], [0.6, -0.48, 0.64], [0.6, 0.48, -0.64]])
def test_directions_have_the_moments_of_their_densities(numpy_arrays, axis):
    axis = np.array(axis, np.float32)[:, None]
    points = bits_reversed(reversed_sobol_points(0, 2**14).ravel()).reshape(-1, 2) / 2.0**32
    u, v = points.T.astype(np.float32)
    cosine = cosine_direction(numpy_arrays, axis, u, v)
    cone = cone_direction(numpy_arrays, axis, np.float32(0.3), u, v)
    disc = disc_point(numpy_arrays, axis, u, v)
    for unit in (cosine, cone):
        np.testing.assert_allclose(np.linalg.norm(unit, axis=0), 1.0, atol=1e-6)
    # The mean along the axis is 2/3 for cos θ/π and (1 + 0.3)/2 for the cone. Across the axis it is 0.
    np.testing.assert_allclose(cosine.mean(axis=1), axis[:, 0] * 2 / 3, atol=1e-3)
    np.testing.assert_allclose(cone.mean(axis=1), axis[:, 0] * 0.65, atol=1e-3)
    assert (axis[:, 0] @ cone).min() >= 0.3 - 1e-6
    np.testing.assert_allclose(axis[:, 0] @ disc, 0.0, atol=1e-6)
    assert np.mean(np.sum(disc**2, axis=0)) == pytest.approx(0.5, abs=1e-3)
