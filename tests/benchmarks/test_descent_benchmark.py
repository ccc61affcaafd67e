"""The benchmark of the descent, on a planted problem: what it counts is what it says."""

import numpy as np
import pytest

import benchmarks.speed.descent as descent
from vpltune.tuner.fitting.planted_problem import planted_problem


def test_steps_are_counted_from_none():
    losses = np.array([4.0, 2.0, 1.0009, 1.0, 1.0])
    assert descent.steps_to(losses, 1.0) == 2.0
    assert descent.steps_to(losses[3:], 1.0) == 0.0
    assert descent.steps_to(losses[:2], 1.0) == float("inf")


@pytest.mark.slow
def test_all_starts_of_a_planted_problem_end_together(monkeypatch):
    """And sooner than Adam's best rate; `least` is what both of them know."""
    monkeypatch.setattr(descent, "STARTS", 4)
    reached, steps = descent.scene_rows("planted", planted_problem(2).views)
    assert (reached.name, reached.value) == ("reached.planted", 1.0)
    assert (steps.name, steps.against) == ("steps.planted", "adam")
    assert 0.0 < steps.value < steps.against_value
