"""The benchmark of automatic views: what it measures in an image whose shares are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.harness.hard_scenes import hard_scenes
from benchmarks.quality.automatic_views import bounce_only, largest_surface


def captured(depth: np.ndarray, normal: np.ndarray, lit: np.ndarray):
    """A frame of 8 × 10 pixels at (column, row, depth)."""
    rows, columns = np.mgrid[:8, :10]
    return SimpleNamespace(
        valid=depth > 0.0,
        depth=depth,
        position_world=np.stack([columns, rows, depth], axis=-1),
        normal_world=normal,
        direct_irradiance=np.repeat(lit[..., None].astype(float), 3, axis=2),
    )


def test_shares_are_those_of_the_pixels():
    """Two columns of background, five of one plane, three of another; a quarter of the surfaces is dark."""
    depth = np.full((8, 10), 5.0)
    depth[:, :2], depth[:, 7:] = 0.0, 9.0
    normal = np.tile([0.0, 0.0, -1.0], (8, 10, 1))
    lit = np.ones((8, 10), bool)
    lit[:2] = False
    frame = captured(depth, normal, lit)
    assert largest_surface(frame) == pytest.approx(0.5)
    assert bounce_only(frame) == pytest.approx(0.25)


def test_hard_scenes_have_neither_cameras_nor_lights():
    makers = hard_scenes()
    assert makers
    for name, make in makers.items():
        scene = make()
        assert scene.name == name and not scene.cameras and not scene.lights
        assert scene.triangle_count() > 0
