"""The table of parameters: each value, its position in the allowed range, and its interval."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ParameterSpec
from vpltune.tuner.report.page_text import finite, number, words
from vpltune.tuner.report.scaled_axis import Axis

# Width and margin of a range bar in the units of its SVG. A choice; charts.html.j2 draws the same bar.
BAR_WIDTH = 180.0
_MARGIN = 5.0


@dataclass(frozen=True)
class RangeBar:
    """Positions along a bar that represents the allowed range, in the units of its SVG."""

    value: float
    default: float
    interval: tuple[float, float] | None
    """Left end and width."""
    description: str
    """The same in words, for readers who cannot see it."""


@dataclass(frozen=True)
class ParameterRow:
    """One row of the table. All strings are ready to be shown."""

    name: str
    symbol: str
    value: str
    default: str
    unit: str
    meaning: str
    bar: RangeBar | None
    interval: str
    """The 90 % interval; empty if unknown."""
    source: str
    """What determined the value: the scene, the prior, the fit, or none of them."""
    trades_with: str
    """Names of the parameters that it trades off against."""
    fitted: bool
    """Whether the parameter can be fitted."""


def parameter_rows(parameters: Mapping[str, Any], uncertainty: Mapping[str, Any]) -> list[ParameterRow]:
    """One row for each parameter of metrics.json: those that this version knows, then any others.

    Args:
        parameters: Value of each parameter.
        uncertainty: The part `uncertainty` of metrics.json: interval and source of each fitted parameter.
    """
    specs = {spec.name: spec for spec in ARTIST_PARAMETERS}
    known = [
        _row(specs[name], parameters[name], uncertainty.get(name, {})) for name in specs if name in parameters
    ]
    unknown = [
        ParameterRow(name, "", number(value, 4), "", "", "", None, "", "unknown to this version", "", False)
        for name, value in parameters.items()
        if name not in specs
    ]
    return known + unknown


def _row(spec: ParameterSpec, raw: Any, doubt: Mapping[str, Any]) -> ParameterRow:
    low, high = finite(doubt.get("low")), finite(doubt.get("high"))
    interval = (low, high) if low is not None and high is not None and low <= high else None
    trades = doubt.get("trades_with")
    return ParameterRow(
        name=spec.name,
        symbol=spec.symbol,
        value=number(raw, 4),
        default=number(spec.default, 4),
        unit=spec.unit,
        meaning=spec.meaning,
        bar=_bar(spec, finite(raw), interval),
        interval=f"{number(interval[0])} to {number(interval[1])}" if interval else "",
        source=_source(spec, doubt),
        trades_with=", ".join(words(str(name)) for name in trades) if isinstance(trades, list) else "",
        fitted=spec.fitted or bool(doubt),
    )


def _source(spec: ParameterSpec, doubt: Mapping[str, Any]) -> str:
    if "determined" in doubt:
        return "the scene" if doubt["determined"] is True else "the prior"
    return "the fit" if spec.fitted else "not fitted"


def _bar(spec: ParameterSpec, value: float | None, interval: tuple[float, float] | None) -> RangeBar | None:
    if value is None:
        return None
    axis = Axis(float(spec.low), float(spec.high), _MARGIN, BAR_WIDTH - _MARGIN, spec.scale)
    described = f"{number(value, 4)} in the allowed range from {number(spec.low)} to {number(spec.high)}"
    ends = None
    if interval is not None:
        left, right = (axis.place(end) for end in interval)
        ends = (left, max(round(right - left, 2), 1.0))
        described += f", 90 % interval {number(interval[0])} to {number(interval[1])}"
    return RangeBar(
        axis.place(value),
        axis.place(float(spec.default)),
        ends,
        f"{described}; default {number(spec.default)}",
    )
