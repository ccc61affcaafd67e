"""Drawings of a page, as numbers that templates/charts.html.j2 writes as SVG."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from vpltune.tuner.report.page_text import finite, number, words
from vpltune.tuner.report.scaled_axis import Axis, Tick, axis_around

WIDTH, HEIGHT = 640.0, 300.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 66.0, 22.0, 14.0, 46.0

MOST_DOTS = 40

Point = tuple[float, float]


@dataclass(frozen=True)
class Mark:
    """A point that is named."""

    x: float
    y: float
    kind: str
    """Its colour: a variant's name, or `plain`."""
    label: str = ""
    anchor: str = "start"


@dataclass(frozen=True)
class LineChart:
    """A line in a frame with ticks; `description` says in words what it shows."""

    title: str
    description: str
    x_label: str
    y_label: str
    x_ticks: list[Tick]
    y_ticks: list[Tick]
    line: list[Point]
    marks: list[Mark]
    dotted: bool
    """Whether each value gets a dot: only where there is room for them."""
    levels: list[tuple[float, str]]
    """Heights of horizontal lines, and what they stand for."""


@dataclass(frozen=True)
class Bar:
    """A bar from 0 to a value; places are shares of the chart's width, in [0, 1]."""

    label: str
    left: float
    width: float
    negative: bool
    text: str


@dataclass(frozen=True)
class BarChart:
    zero: float
    """Where 0 stands: at the left end, unless a value is negative."""
    bars: list[Bar]


def loss_chart(loss: Mapping[str, Any]) -> LineChart | None:
    """The loss at every step of the descent; None where fewer than two are known."""
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
    """relMSE against milliseconds a frame; None where no point has both.

    Args:
        front: points with `milliseconds` and `relmse`.
        ceiling: relMSE of the ceiling, drawn as a level, or None.
        budget: milliseconds that were asked for, marked on the axis, or None.
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
            Mark(x.place(wanted), HEIGHT - _BOTTOM, "budget", f"asked for {number(wanted)} ms", "middle")
        )
    return LineChart(
        "Quality against milliseconds",
        f"{len(points)} configs, from {number(times[0])} ms at relMSE {number(errors[0])} "
        f"to {number(times[-1])} ms at relMSE {number(errors[-1])}.",
        "milliseconds a frame, log scale",
        "relMSE, log scale",
        [(x.place(tick), number(tick)) for tick in x.ticks()],
        [(y.place(tick), number(tick)) for tick in y.ticks()],
        line,
        marks,
        True,
        [(y.place(level), "ceiling")] if level is not None and level > 0.0 else [],
    )


def bar_chart(values: Mapping[str, Any], word: Callable[[Any], str] = number) -> BarChart | None:
    """Bars of the numbers among `values`, in their order; None where there is none."""
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
