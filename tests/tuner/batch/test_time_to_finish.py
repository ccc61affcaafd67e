"""The forecast is exact for scenes alike, an honest interval otherwise, and absent before three scenes."""

import io

import numpy as np
import pytest
from rich.console import Console
from rich.progress import Progress, TextColumn

from vpltune.cli.batch_display import BarDisplay, ending, time_left
from vpltune.tuner.batch.time_to_finish import Forecast, SceneSeconds, seconds_left


def forecast_of(make_job, sizes, workers):
    forecast = Forecast(workers)
    jobs = [make_job(f"{index}.glb", size=size) for index, size in enumerate(sizes)]
    forecast.found(jobs)
    return forecast, jobs


def start(forecast, job, now):
    forecast.happened({"event": "scene_started", "key": job.key}, now)


def finish(forecast, job, now, seconds, status="done"):
    event = {"event": "record", "key": job.key, "status": status, "seconds": seconds, "attempts": 1}
    forecast.happened(event, now)


def test_scenes_alike_are_forecast_to_a_tenth(make_job):
    forecast, jobs = forecast_of(make_job, [5] * 10, workers=2)
    for job in jobs[:4]:
        start(forecast, job, 0.0)
        finish(forecast, job, 10.0, seconds=10.0)
    # Six scenes of ten seconds on two workers.
    assert forecast.seconds_left(20.0) == pytest.approx((30.0, 30.0), rel=0.1)
    start(forecast, jobs[4], 20.0)
    assert forecast.seconds_left(25.0) == pytest.approx((27.5, 27.5), rel=0.1)


def test_nothing_is_said_before_three_scenes_were_fitted(make_job):
    forecast, jobs = forecast_of(make_job, [5] * 4, workers=1)
    finish(forecast, jobs[0], 1.0, seconds=0.0, status="refused")
    finish(forecast, jobs[1], 2.0, seconds=3.0)
    finish(forecast, jobs[2], 3.0, seconds=3.0)
    assert forecast.seconds_left(2.0) is None
    assert time_left(forecast) == ""


def test_larger_scenes_are_expected_to_take_longer():
    model = SceneSeconds()
    for size in (100, 200, 400):
        model.add(size, 5.0 + 0.1 * size)
    assert model.expected(800) == pytest.approx(85.0)
    assert model.spread() == pytest.approx(0.0, abs=1e-9)


def test_no_line_leads_below_zero_or_downwards():
    falling, steep = SceneSeconds(), SceneSeconds()
    for size, seconds in ((100, 9.0), (200, 3.0)):
        falling.add(size, seconds)
    for size, seconds in ((100, 1.0), (200, 9.0)):
        steep.add(size, seconds)
    assert falling.expected(1000) == falling.expected(0) == 6.0
    assert steep.expected(0) >= 0.0


def test_one_long_scene_is_waited_for():
    model = SceneSeconds()
    for size in (10, 20, 1000):
        model.add(size, float(size))
    assert seconds_left(model, [], [(1000, 0.0), (10, 0.0)], workers=8)[1] == pytest.approx(1000.0)


def test_the_span_holds_the_truth_four_times_in_five():
    """Forecasts at half time of random batches, whose times scatter by e^N(0, 0.5) about a line in size."""
    random = np.random.default_rng(7)
    held = 0
    for _ in range(200):
        sizes = random.integers(1, 1000, 60)
        seconds = (5.0 + 0.02 * sizes) * np.exp(random.normal(0.0, 0.5, 60))
        order = np.argsort(-sizes)
        model = SceneSeconds()
        for index in order[:30]:
            model.add(int(sizes[index]), float(seconds[index]))
        free = np.zeros(4)
        for index in order[30:]:
            free[free.argmin()] += seconds[index]
        low, high = seconds_left(model, [int(sizes[index]) for index in order[30:]], [], workers=4)
        held += low <= free.max() <= high
    assert held >= 160


def test_lines_for_a_pipe():
    failed = {"event": "attempt_failed", "name": "a.glb", "attempt": 2, "reason": "it\nstopped"}
    assert ending(failed) == "a.glb: attempt 2 failed: it stopped"
    record = {"event": "record", "name": "a.glb", "status": "refused", "seconds": 0.04, "reason": "empty"}
    assert ending(record) == "refused a.glb (0.0 s): empty"
    assert ending(record | {"status": "done"}) == "done a.glb (0.0 s)"
    assert ending({"event": "scene_started", "name": "a.glb"}) == ""


def test_bars_on_a_terminal(make_job):
    """Finished scenes scroll up, a running scene shows its stage, and names are not parsed as markup."""
    screen = io.StringIO()
    forecast, jobs = forecast_of(make_job, [5] * 4, workers=1)
    columns = (TextColumn("{task.description} {task.percentage:.0f} {task.fields[note]}", markup=False),)
    with Progress(*columns, console=Console(file=screen, force_terminal=True, width=100)) as bars:
        display = BarDisplay(forecast, bars)
        display.found(jobs, already_done=4)
        display.happened({"event": "scene_started", "key": jobs[0].key, "name": "[red]a.glb"})
        display.happened(
            {"event": "stage", "key": jobs[0].key, "name": "[red]a.glb", "stage": "capture", "share": 0.5}
        )
        bars.refresh()
        shown = screen.getvalue()
        record = {"event": "record", "key": jobs[0].key, "name": "[red]a.glb", "status": "done"}
        display.happened({**record, "seconds": 2.0, "attempts": 1, "reason": ""})
        bars.refresh()
        assert len(bars.tasks) == 1
    assert "[red]a.glb 50 capture" in shown
    assert "scenes 50" in shown
    assert "done [red]a.glb (2.0 s)" in screen.getvalue()
    assert bars.tasks[0].percentage == 62.5


@pytest.mark.parametrize(
    ("span", "words"),
    [
        (None, ""),
        ((0.0, 0.0), ""),
        ((3.2, 8.0), "; 3 to 8 s left"),
        ((100.0, 130.0), "; 2 min left"),
        ((30.0, 200.0), "; 0 to 3 min left"),
        ((7000.0, 9000.0), "; 2 h left"),
    ],
)
def test_time_left_in_words(monkeypatch, span, words):
    forecast = Forecast(1)
    monkeypatch.setattr(forecast, "seconds_left", lambda now: span)
    assert time_left(forecast) == words
