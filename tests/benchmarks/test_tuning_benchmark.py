"""The searches of the tuning benchmark find what they should, and its rows say what was measured."""

import contextlib
import math
import time

import numpy as np
import pytest
from built_scenes import colored_room
from converged_views import corner_view
from own_reference import own_reference

from benchmarks.tuning.tuning import Spent, rows_of, spent_to
from benchmarks.tuning.tuning_objectives import (
    SPACE,
    SURROGATE_SPACE,
    CappedObjective,
    CountingRuntime,
    RuntimeLoss,
    SearchIsOver,
    SurrogateLoss,
    Trace,
)
from benchmarks.tuning.tuning_searches import SEARCHES
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.tuner.fitting.fit_density import rotated_views
from vpltune.tuner.surrogate.captured_view import CapturedView

AIM = np.array([0.37, 0.62, 0.81])


def bowl(point):
    return float(((point - AIM) ** 2).sum()) + 0.5


def searched(name, evaluations):
    trace = Trace()
    with contextlib.suppress(SearchIsOver):
        SEARCHES[name](
            CappedObjective(bowl, trace, lambda: 7, evaluations, seconds=math.inf), np.full(3, 0.1)
        )
    return trace


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

    with contextlib.suppress(SearchIsOver):
        SEARCHES[name](CappedObjective(loss, Trace(), lambda: 0, 12, seconds=math.inf), np.full(3, 0.1))
    assert len(seen) == 12
    assert all(((point >= 0.0) & (point <= 1.0)).all() for point in seen)
    if name != "cma_es":
        np.testing.assert_allclose(seen[0], 0.1)


def test_searches_one_after_the_other_share_a_trace_and_a_clock():
    trace, started = Trace(), time.perf_counter()
    for evaluations in (5, 3):
        with contextlib.suppress(SearchIsOver):
            objective = CappedObjective(
                bowl, trace, lambda: 7, evaluations, seconds=math.inf, started=started
            )
            SEARCHES["random_search"](objective, np.full(3, 0.1))
    assert trace.evaluations == 8
    with pytest.raises(SearchIsOver):
        CappedObjective(bowl, trace, lambda: 7, seconds=60.0, started=started - 61.0)(AIM)
    assert trace.losses[-1] == 0.5


def test_the_surrogate_stands_for_the_runtime(gl_context):
    """All seven parameters away from the defaults: to 1e-3, and the runtime's frames are counted."""
    base = ArtistParameters(vpl_count=24, lloyd_iterations=2)
    config = TunedConfig(base, quality=Quality(rsm_resolution=128), light=ONE_BOUNCE)
    runtime = CountingRuntime(colored_room(), context=gl_context)
    view, rotations = corner_view("spot", (24, 18)), ((0.0, 0.0), (0.3, 0.6))
    captured = runtime.capture(view, config)
    views = (CapturedView(view, own_reference(captured), captured),)
    point = np.array([0.45, 0.3, 0.05, 0.6, 0.7, 0.8, 0.4])
    assert len(SPACE.names) == len(point)
    loss = RuntimeLoss(runtime, views, rotations, config)
    runtime.frames = 0
    drawn = loss(point)
    assert runtime.frames == 2
    parameters = SPACE.parameters(point, base)
    assert parameters.lloyd_iterations == 2
    rotated = rotated_views(runtime, views, config.with_parameters(parameters), rotations)
    assert runtime.frames == 4
    surrogate = SurrogateLoss(rotated, parameters)(point[: len(SURROGATE_SPACE.names)])
    assert surrogate == pytest.approx(drawn, rel=1e-3)
    images = iter(rotated)
    assert loss.of_images(lambda *_: next(images).captured.indirect_irradiance) == pytest.approx(drawn)


def search(seconds, losses, spent):
    return {
        "seconds": seconds,
        "losses": losses,
        "frames": [round(20 * second) for second in seconds],
        "spent_seconds": spent,
        "spent_frames": round(20 * spent),
        "held_out": [2.0 * loss for loss in reversed(losses)],
    }


def test_what_was_spent_to_an_aim():
    """What was kept need not become better at rotations that were not given."""
    trace = search([1.0, 2.0, 3.0], [5.0, 4.0, 3.95], 9.0)
    assert spent_to(trace, 4.1) == Spent(2.0, 40, True)
    assert spent_to(trace, 3.9) == Spent(9.0, 180, False)
    assert spent_to(trace, 8.1, "held_out") == Spent(1.0, 20, True)


def test_rows_are_medians_of_ratios_and_say_what_is_a_bound():
    def scene(ours, theirs, reached):
        return {
            "searches": {"ours": search([ours], [1.0], ours)}
            | {
                f"{name}{form}": search([theirs], [1.005 if reached else 1.5], 3.0 * theirs)
                for name in SEARCHES
                for form in ("", "_surrogate")
            }
            | {"cma_es": search([0.5 * theirs], [1.009 if reached else 1.5], 2.5 * theirs)},
            "default_held_out_relmse": 5.0,
            "losses": {"default": 2.0, "bgfx_formula": 30.0, "babylon_formula": 400.0},
        }

    rows = {
        row.name: row
        for row in rows_of([scene(0.1, 2.0, True), scene(0.2, 8.0, True), scene(0.1, 9.0, False)])
    }
    assert rows["optuna_tpe"].ratio == pytest.approx(40.0)
    assert rows["cma_es"].ratio == pytest.approx(20.0)
    assert rows["best_search"].ratio == pytest.approx(20.0)
    assert rows["best_search_frames"].ratio == pytest.approx(20.0)
    assert "1 of 3 were stopped before" in rows["best_search"].against
    assert "3 of 3 within 1 %" in rows["cma_es"].against
    assert rows["best_search_held_out"].ratio == pytest.approx(20.0)
    assert rows["loss_default"].ratio == pytest.approx(2.0)
    assert rows["loss_ours"].ratio == pytest.approx(1.0)
    assert rows["held_out_relmse_cma_es"].ratio == pytest.approx(1.009)
    assert rows["held_out_relmse_default"].ratio == pytest.approx(2.5)
