"""`bench sky`: its closed forms, its table, and a small run."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.harness.row import Row
from benchmarks.harness.sky_scenes import sky_scenes
from benchmarks.quality import sky
from benchmarks.quality.sky import CONFIG, measured_rows, table

NAMES = ("well", "small_window", "large_window", "under_table")


def test_the_exact_light_is_that_of_tables_of_form_factors():
    """Two squares of side 2 at distance 2: 0.1998 (Howell, Siegel and Mengüç 2010, C-11), here by a grid of
    40² points to 0.1 %. Beneath the middle of the table one of half the distance hides 0.5541, by C-12."""
    scenes = {scene.name: scene for scene in sky_scenes((8, 8))}
    assert tuple(scenes) == NAMES
    across = (np.arange(40) + 0.5) / 20.0 - 1.0
    grid = np.stack(np.meshgrid(across, [0.0], across), axis=-1).reshape(-1, 3)
    assert scenes["well"].exact(grid).mean() == pytest.approx(0.1998 * np.pi, rel=1e-3)
    # A quarter, of sides a = b = 1 at distance 1: 2·(1/√2)·atan(1/√2) ÷ (2π).
    hidden = 4.0 * np.sqrt(0.5) * np.arctan(np.sqrt(0.5)) / np.pi
    assert scenes["under_table"].exact(np.zeros((1, 3)))[0] == pytest.approx((1.0 - hidden) * np.pi)


def test_table():
    maps = "32 lights with maps"
    made = [
        Row("96x96.small_window.mean", 1.0, "of the exact", maps, 1.35),
        Row("96x96.small_window.rms", 0.1, "of the mean", maps, 2.0),
        Row("96x96.small_window.time", 3.0, "s of processor time", maps, 2.0),
    ]
    assert table(made).splitlines()[-1] == ("| small window | 96×96 | 1.000 | 1.350 | 0.100 | 2.000 | 1.50 |")


@pytest.mark.slow
def test_a_small_run(monkeypatch):
    """Along rays the mean is right to 5 % at 48 × 48, and pixels err less than with maps."""
    small = replace(CONFIG, quality=replace(CONFIG.quality, rsm_resolution=64))
    monkeypatch.setattr(sky, "CONFIG", small)
    rows = {row.name: row for row in measured_rows(lambda stage, share: None, ((48, 48),), 1)}
    assert set(rows) == {f"48x48.{name}.{figure}" for name in NAMES for figure in ("mean", "rms", "time")}
    for name in NAMES:
        assert rows[f"48x48.{name}.mean"].value == pytest.approx(1.0, abs=0.05)
        assert rows[f"48x48.{name}.rms"].ratio < 1.0
        assert rows[f"48x48.{name}.time"].value > 0.0
