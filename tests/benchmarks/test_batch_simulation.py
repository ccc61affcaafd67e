"""The simulated queue against queues that can be worked out by hand."""

import numpy as np
import pytest

from benchmarks.speed import batch_simulation
from benchmarks.speed.batch_simulation import STARTUP_S, DrawnLibrary, Head, batch_hours, drawn_library

IDLE_HEAD = Head(0.0, 0.0, 0.0, 0.0)


def library_of(seconds, sizes=None):
    sizes = np.array(seconds if sizes is None else sizes, np.float64)
    return DrawnLibrary(sizes, np.array(seconds, np.float64), np.zeros(len(sizes)))


def seconds_of(*arguments, **options):
    return 3600.0 * batch_hours(*arguments, **options)


def test_equal_scenes_are_shared_out():
    library = library_of([10.0] * 12)
    assert seconds_of(library, 4, IDLE_HEAD) == pytest.approx(STARTUP_S + 30.0)
    assert seconds_of(library, 4, IDLE_HEAD, dealt=True) == pytest.approx(STARTUP_S + 30.0)
    assert seconds_of(library, 100, IDLE_HEAD) == pytest.approx(STARTUP_S + 10.0)


def test_a_long_scene_begun_last_is_waited_for():
    library = library_of([10.0] * 10 + [50.0])
    assert seconds_of(library, 2, IDLE_HEAD) == pytest.approx(STARTUP_S + 80.0)
    assert seconds_of(library, 2, IDLE_HEAD, largest_first=False) == pytest.approx(STARTUP_S + 100.0)


def test_a_slow_head_is_what_everybody_waits_for():
    library = library_of([1.0] * 1000)
    slow = Head(0.0, 0.1, 0.0, 0.0)
    assert seconds_of(library, 1000, slow) == pytest.approx(STARTUP_S + 1.0 + 100.0)


def test_a_scene_that_hangs_takes_its_time_limit():
    library = DrawnLibrary(np.ones(2), np.ones(2), np.array([0.0, 1.0]))
    assert seconds_of(library, 2, IDLE_HEAD, hang_seconds=60.0) == pytest.approx(STARTUP_S + 60.0)


def test_libraries_are_drawn_with_the_stated_shares():
    """100,000 draws: shares within four deviations, and seconds as the measured ones."""
    library = drawn_library(100_000, np.random.default_rng(0))
    assert library.hanging.mean() == pytest.approx(batch_simulation.HANGING, abs=4e-4)
    refused = library.plain_seconds == batch_simulation.REFUSED_S
    assert refused.mean() == pytest.approx(batch_simulation.REFUSED, abs=2e-3)
    assert set(library.bytes) == {float(size) for size, _ in batch_simulation.MEASURED}


def test_rows_have_every_size(monkeypatch):
    monkeypatch.setattr(batch_simulation, "RECORDS", 50)
    monkeypatch.setattr(batch_simulation, "SIZES", ((100, 10), (1_000, 10)))
    rows = {row.name: row for row in batch_simulation.rows(lambda stage, share: None)}
    assert rows["simulated_100_scenes_10_workers_h"].ratio >= 1.0
    assert rows["simulated_hangs_tried_4_times_for_an_hour_h"].ratio >= 1.0
