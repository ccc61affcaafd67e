"""Splatted maps, the rival in a benchmark, are made as well as they can be: or beating them says nothing."""

import numpy as np
from built_scenes import quad, scene_of

from benchmarks.quality.splatted_maps import SIZE, _filled, _splatted, surface_points


def test_points_are_spread_evenly_by_area():
    """Two squares, one of four times the area: a fifth of 20,000 points on the small one, to three sigmas."""
    scene = scene_of(
        [quad((0, 0, 0), (1, 0, 0), (0, 0, 1)), quad((0, 5, 0), (2, 0, 0), (0, 0, 2))], [(0.5, 0.5, 0.5)]
    )
    points = surface_points(scene, 20_000, np.random.default_rng(0))
    assert points.area == 5.0
    assert abs((points.position[:, 1] < 1.0).mean() - 0.2) < 3.0 * np.sqrt(0.2 * 0.8 / 20_000)
    np.testing.assert_allclose(np.abs(points.normal[:, 1]), 1.0)


def test_the_nearest_point_is_kept_and_holes_are_filled():
    """Two points on one ray: the nearer is seen. Pull-push leaves no hole, and moves nothing else."""
    offset = np.array([[0.2, 0.1, 2.0], [0.1, 0.05, 1.0], [-3.0, 0.0, 0.5], [0.0, 0.0, -1.0]])
    nearest = _splatted(offset, 1e-3)
    assert sorted(nearest[nearest >= 0]) == [1, 2]
    filled = _filled(nearest, np.linalg.norm(offset, axis=1))
    assert filled.shape == (SIZE, SIZE)
    assert set(np.unique(filled)) == {1, 2}
    np.testing.assert_array_equal(filled[nearest >= 0], nearest[nearest >= 0])


def test_a_wide_splat_covers_its_neighbours():
    """A point as wide as three texels is seen in nine."""
    texel = np.sqrt(2.0 * np.pi) / SIZE
    nearest = _splatted(np.array([[0.0, 0.0, 1.0]]), 1.5 * texel)
    assert (nearest == 0).sum() == 9
