"""The density benchmark's arithmetic; what it measures is not judged here."""

import numpy as np
import pytest

from benchmarks.tuning.density import COUNTS, SceneCurves, count_for_error, curve_rows, write_curves
from vpltune.renderer.config.artist_parameters import ArtistParameters


def power_law(scale: float) -> dict[int, float]:
    return {count: scale / count for count in COUNTS}


def test_the_count_for_an_error_is_read_off_the_curve():
    """Exact on a power law between counts; held at the ends; a bump upwards is not believed."""
    curve = power_law(2.0)
    for count in (8.0, 50.0, 777.0):
        assert count_for_error(curve, 2.0 / count) == pytest.approx(count)
    assert count_for_error(curve, 1e-6) == pytest.approx(COUNTS[-1])
    assert count_for_error(curve | {256: 1.0}, 2.0 / 128) == pytest.approx(128.0)


def test_rows_and_files(tmp_path):
    """Fitted with half the error: half as many VPLs as uniform, 4 times the error of 256 default ones."""
    curves = [
        SceneCurves("room", *[power_law(2.0)] * 3, power_law(1.0), {2: 0.01}, ArtistParameters()),
        SceneCurves("hall", *[power_law(2.0)] * 3, power_law(1.0), {2: 0.01}, ArtistParameters()),
    ]
    rows = {row.name: row for row in curve_rows(curves)}
    for name in ("vpls_for_same_error.room", "vpls_for_same_error.hall", "vpls_for_same_error"):
        assert rows[name].ratio == pytest.approx(0.5)
    assert rows["tuned_32_over_default_256"].value == pytest.approx(4.0)
    assert rows["tuned_32_over_discs_256"].value == pytest.approx(4.0)
    assert rows["tuned_vpls_for_default_256.room"].value == pytest.approx(128.0)
    assert rows["tuned_32_a_pixel_2x2_over_default_256"].value == pytest.approx(0.01 / (2.0 / 256))
    assert np.isfinite([row.ratio for row in rows.values()]).all()
    write_curves(tmp_path, curves)
    assert (tmp_path / "curves.png").read_bytes()[:4] == b"\x89PNG"
    assert '"hall"' in (tmp_path / "curves.json").read_text(encoding="utf-8")
