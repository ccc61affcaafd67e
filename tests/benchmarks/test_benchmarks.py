"""Benchmarks are found, run and reported; what they measure is not judged here."""

import json
import math

import pytest

import benchmarks
import benchmarks.harness.machine
from benchmarks.harness.registry import benchmark_names
from benchmarks.harness.row import Row
from vpltune.cli.program import run


def test_a_row_has_the_ratio():
    row = Row("fit_cold_s", 30.0, "s", "limit", 60.0)
    assert row.as_dict() == {
        "name": "fit_cold_s",
        "value": 30.0,
        "unit": "s",
        "against": "limit",
        "against_value": 60.0,
        "ratio": 0.5,
    }
    assert math.isnan(Row("a", 1.0, "s", "nothing", 0.0).ratio)


def test_modules_that_are_no_benchmark_are_not_listed():
    assert not {"row", "machine", "registry"} & set(benchmark_names())


def test_the_machine_is_one_line():
    description = benchmarks.harness.machine.machine_description()
    assert "\n" not in description
    assert "cores" in description
    assert "GiB" in description


@pytest.mark.parametrize("names", [["boil"], ["all"], []])
def test_bench_prints_the_rows(capfd, monkeypatch, names):
    row = Row("boil_s", 2.0, "s", "limit", 4.0)

    def run_benchmark(name, progress):
        progress(name, 1.0)
        return [row]

    monkeypatch.setattr(benchmarks, "benchmark_names", lambda: ("boil",))
    monkeypatch.setattr(benchmarks, "run_benchmark", run_benchmark)
    monkeypatch.setattr(benchmarks.harness.machine, "machine_description", lambda: "a machine")
    assert run(["bench", *names, "--json"]) == 0
    shown = capfd.readouterr()
    assert json.loads(shown.out) == {"machine": "a machine", "rows": [row.as_dict()]}
    assert shown.err == "vpltune: boil\n"
    assert run(["bench", "boil"]) == 0
    assert "boil_s" in capfd.readouterr().out


def test_an_interrupted_benchmark_prints_the_rows_that_it_has(capfd, monkeypatch):
    """Exit code 130 and one row; without any row, as for every command."""
    row = Row("boil_s", 2.0, "s", "limit", 4.0)

    def run_benchmark(name, progress):
        if name == "boil":
            yield row
        raise KeyboardInterrupt

    monkeypatch.setattr(benchmarks, "benchmark_names", lambda: ("boil", "cool"))
    monkeypatch.setattr(benchmarks, "run_benchmark", run_benchmark)
    monkeypatch.setattr(benchmarks.harness.machine, "machine_description", lambda: "a machine")
    assert run(["bench", "boil", "--json"]) == 130
    shown = capfd.readouterr()
    assert json.loads(shown.out)["rows"] == [row.as_dict()]
    assert "interrupted after 1 row" in shown.err
    assert run(["bench", "cool"]) == 130
    assert capfd.readouterr().err == "vpltune: interrupted\n"


def test_a_row_that_was_left_out_has_dashes(capfd, monkeypatch):
    """And null in JSON, which has no number that is none."""
    row = Row("boil_s", math.nan, "s", "left out", 4.0)
    monkeypatch.setattr(benchmarks, "benchmark_names", lambda: ("boil",))
    monkeypatch.setattr(benchmarks, "run_benchmark", lambda name, progress: iter([row]))
    monkeypatch.setattr(benchmarks.harness.machine, "machine_description", lambda: "a machine")
    assert run(["bench", "boil", "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["rows"][0]["value"] is None
    assert run(["bench", "boil"]) == 0
    shown = capfd.readouterr().out
    assert "–" in shown and "nan" not in shown


@pytest.mark.slow
def test_steadier_than_without(monkeypatch):
    """A short run of the motion benchmark: the snapped sun is at least ten times as steady."""
    import benchmarks.quality.motion as motion

    for name, value in {"SIZE": (32, 24), "FRAMES": 8, "VPL_COUNT": 64, "RSM_RESOLUTION": 128}.items():
        monkeypatch.setattr(motion, name, value)
    for name, value in {"REFERENCE_FRAMES": 2, "REFERENCE_VPLS": 1024}.items():
        monkeypatch.setattr(motion, name, value)
    rows = {row.name: row for row in motion.rows(lambda stage, share: None)}
    assert set(rows) == {
        "motion_spot_default",
        "motion_camera_default",
        "motion_spot_filtering",
        "motion_sun_snapping",
        "motion_sun_filtering",
        "motion_sun_both",
    }
    assert rows["motion_sun_snapping"].value < 0.1 * rows["motion_sun_snapping"].against_value
    assert rows["motion_sun_both"].value < 0.1 * rows["motion_sun_both"].against_value
