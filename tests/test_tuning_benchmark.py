"""The searches of the tuning benchmark find what they should, and its rows say what was measured."""

import contextlib
import time

import numpy as np
import pytest

from benchmarks.tuning import rows_of, time_to
from benchmarks.tuning_objectives import CappedObjective, SearchIsOver
from benchmarks.tuning_searches import SEARCHES

AIM = np.array([0.37, 0.62, 0.81])


def bowl(point):
    return float(((point - AIM) ** 2).sum()) + 0.5


def searched(name, evaluations):
    objective = CappedObjective(bowl, lambda: 7, time.perf_counter(), evaluations, 60.0)
    with contextlib.suppress(SearchIsOver):
        SEARCHES[name](objective, np.full(3, 0.1))
    return objective.trace


@pytest.mark.parametrize(
    ("name", "within"),
    [
        ("finite_differences", 1e-5),
        ("cma_es", 1e-3),
        ("grid_narrowing", 1e-3),
        ("optuna_tpe", 0.1),
        ("random_search", 0.1),
    ],
)
def test_every_search_nears_the_bottom_of_a_bowl(name, within):
    trace = searched(name, 200)
    assert trace.losses[-1] - 0.5 < within
    assert trace.evaluations <= 200
    assert (np.diff(trace.losses) < 0.0).all()
    assert (np.diff(trace.seconds) >= 0.0).all()


@pytest.mark.parametrize("name", SEARCHES)
def test_a_search_ends_at_its_cap_and_begins_at_the_start(name):
    seen = []

    def loss(point):
        seen.append(point)
        return bowl(point)

    objective = CappedObjective(loss, lambda: 0, time.perf_counter(), 12, 60.0)
    with contextlib.suppress(SearchIsOver):
        SEARCHES[name](objective, np.full(3, 0.1))
    assert len(seen) == 12
    assert all(((point >= 0.0) & (point <= 1.0)).all() for point in seen)
    if name != "cma_es":
        np.testing.assert_allclose(seen[0], 0.1)


def search(seconds, losses, spent):
    return {"seconds": seconds, "losses": losses, "frames": [2] * len(losses), "spent_seconds": spent}


def test_the_time_to_an_aim():
    """Losses of a search on the surrogate, as the runtime judges them, need not fall."""
    trace = search([1.0, 2.0, 3.0], [5.0, 4.0, 4.2], 9.0)
    assert time_to(trace, 4.1) == (2.0, True)
    assert time_to(trace, 3.9) == (9.0, False)


def test_rows_are_medians_of_ratios_and_say_what_is_a_bound():
    def scene(ours, theirs, reached):
        return {
            "searches": {"ours": search([ours], [1.0], ours)}
            | {
                f"{name}{form}": search([theirs], [1.005 if reached else 1.5], 3.0 * theirs)
                for name in SEARCHES
                for form in ("", "_surrogate")
            },
            "losses": {"default": 2.0, "bgfx_formula": 30.0, "babylon_formula": 400.0},
        }

    rows = {
        row.name: row
        for row in rows_of([scene(0.1, 2.0, True), scene(0.2, 8.0, True), scene(0.1, 9.0, False)])
    }
    assert rows["cma_es"].ratio == pytest.approx(40.0)
    assert "1 of 3 never got there" in rows["cma_es"].against
    assert "3 of 3 within 1 %" in rows["cma_es"].against
    assert rows["loss_default"].ratio == pytest.approx(2.0)
    assert rows["loss_ours"].ratio == pytest.approx(1.0)
