"""The charts of a page as coordinates, which templates/charts.html.j2 draws as SVG."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from vpltune.tuner.report.page_text import finite, number, words
from vpltune.tuner.report.scaled_axis import Axis, Tick, axis_around

# Size and margins of a line chart in the units of its SVG. A choice; charts.html.j2 draws the same frame.
WIDTH, HEIGHT = 640.0, 300.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 66.0, 22.0, 14.0, 46.0

MOST_DOTS = 40
"""A line with more values has no dots. A choice: they would touch."""

Point = tuple[float, float]
"""x and y in the units of the SVG."""


@dataclass(frozen=True)
class Mark:
    """A labelled point."""

    x: float
    y: float
    kind: str
    """CSS class that sets the colour: `default`, `tuned`, `ceiling` or `budget`."""
    label: str = ""
    anchor: str = "start"
    """Side of the label: `start`, `middle` or `end`, as in SVG."""


@dataclass(frozen=True)
class LineChart:
    """A line chart with ticks, in the units of its SVG."""

    title: str
    description: str
    """What the chart shows, in words, for readers who cannot see it."""
    x_label: str
    y_label: str
    x_ticks: list[Tick]
    y_ticks: list[Tick]
    line: list[Point]
    marks: list[Mark]
    dotted: bool
    """Whether each value gets a dot."""
    levels: list[tuple[float, str]]
    """y and label of each horizontal line."""


@dataclass(frozen=True)
class Bar:
    """A bar from 0 to a value. `left` and `width` are shares of the chart's width, in [0, 1]."""

    label: str
    left: float
    width: float
    negative: bool
    text: str


@dataclass(frozen=True)
class BarChart:
    """A list of horizontal bars."""

    zero: float
    """Position of 0 as a share of the width: 0 unless a value is negative."""
    bars: list[Bar]


def loss_chart(loss: Mapping[str, Any]) -> LineChart | None:
    """Chart of the loss over the steps of the descent; None if fewer than two values are known.

    `loss` is the part `loss` of metrics.json; its key `curve` holds one loss per step.
    """
    curve = loss.get("curve")
    values = [finite(value) for value in curve] if isinstance(curve, list) else []
    known = [(step, value) for step, value in enumerate(values) if value is not None]
    if len(known) < 2:
        return None
    losses = [value for _, value in known]
    scale = "log" if min(losses) > 0.0 and max(losses) > 3.0 * min(losses) else "linear"
    x = Axis(0.0, float(len(values) - 1), _LEFT, WIDTH - _RIGHT)
    if scale == "log":
        y = axis_around(losses, HEIGHT - _BOTTOM, _TOP, "log")
    else:
        room = 0.1 * (max(losses) - min(losses)) or 1.0
        y = Axis(min(losses) - room, max(losses) + room, HEIGHT - _BOTTOM, _TOP)
    line = [(x.place(step), y.place(value)) for step, value in known]
    best = min(known, key=lambda pair: pair[1])
    marks = [
        Mark(*line[0], "default", f"start {number(losses[0])}"),
        Mark(x.place(best[0]), y.place(best[1]), "tuned", f"best {number(best[1])}", "end"),
    ]
    return LineChart(
        "Loss at every step",
        f"From {number(losses[0])} at the start to {number(best[1])} at step {best[0]} of {len(values) - 1}.",
        "step",
        "loss, log scale" if scale == "log" else "loss",
        [(x.place(tick), number(tick)) for tick in x.ticks()],
        [(y.place(tick), number(tick)) for tick in y.ticks()],
        line,
        marks,
        len(line) <= MOST_DOTS,
        [],
    )


def pareto_chart(front: Sequence[Mapping[str, Any]], ceiling: Any, budget: Any) -> LineChart | None:
    """Chart of relMSE against frame time; None if no point has both.

    Args:
        front: Points with `milliseconds` and `relmse`.
        ceiling: relMSE of the ceiling, drawn as a horizontal line; None for no line.
        budget: Frame-time budget in milliseconds, marked on the axis; None for no mark.
    """
    points = sorted(
        (milliseconds, error)
        for point in front
        if (milliseconds := finite(point.get("milliseconds"))) is not None
        and (error := finite(point.get("relmse"))) is not None
        and milliseconds > 0.0
        and error > 0.0
    )
    if not points:
        return None
    times, errors = [time for time, _ in points], [error for _, error in points]
    level = finite(ceiling)
    shown = [*errors, level] if level is not None and level > 0.0 else errors
    wanted = finite(budget)
    x = axis_around(
        [*times, wanted] if wanted is not None and wanted > 0.0 else times, _LEFT, WIDTH - _RIGHT, "log"
    )
    y = axis_around(shown, HEIGHT - _BOTTOM, _TOP, "log")
    line = [(x.place(time), y.place(error)) for time, error in points]
    marks = []
    if wanted is not None and wanted > 0.0:
        marks.append(
            Mark(x.place(wanted), HEIGHT - _BOTTOM, "budget", f"budget {number(wanted)} ms", "middle")
        )
    return LineChart(
        "Error against frame time",
        f"{len(points)} configs, from {number(times[0])} ms at relMSE {number(errors[0])} "
        f"to {number(times[-1])} ms at relMSE {number(errors[-1])}.",
        "frame time in ms, log scale",
        "relMSE, log scale",
        [(x.place(tick), number(tick)) for tick in x.ticks()],
        [(y.place(tick), number(tick)) for tick in y.ticks()],
        line,
        marks,
        True,
        [(y.place(level), "ceiling")] if level is not None and level > 0.0 else [],
    )


def bar_chart(values: Mapping[str, Any], word: Callable[[Any], str] = number) -> BarChart | None:
    """Bars for the finite numbers among `values`, in their order; None if there are none.

    `word` formats a number for its bar.
    """
    known = {name: value for name, raw in values.items() if (value := finite(raw)) is not None}
    if not known:
        return None
    low, high = min(0.0, *known.values()), max(0.0, *known.values())
    axis = Axis(low, high if high > low else low + 1.0, 0.0, 1.0)
    zero = axis.share(0.0)
    bars = []
    for name, value in known.items():
        place = axis.share(value)
        bars.append(Bar(words(name), min(place, zero), abs(place - zero), value < 0.0, word(value)))
    return BarChart(zero, bars)
