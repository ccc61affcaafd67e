"""The table of parameters: value, place in the allowed range, and how sure the fit is of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ParameterSpec
from vpltune.tuner.report.page_text import finite, number, words
from vpltune.tuner.report.scaled_axis import Axis

BAR_WIDTH = 180.0
_MARGIN = 5.0


@dataclass(frozen=True)
class RangeBar:
    """Places along a bar `BAR_WIDTH` wide that stands for the allowed range."""

    value: float
    default: float
    interval: tuple[float, float] | None
    """Left end and width."""
    description: str


@dataclass(frozen=True)
class ParameterRow:
    name: str
    symbol: str
    value: str
    default: str
    unit: str
    meaning: str
    bar: RangeBar | None
    interval: str
    """The stated interval, or empty."""
    source: str
    """What the value was determined by."""
    trades_with: str
    fitted: bool


def parameter_rows(parameters: Mapping[str, Any], uncertainty: Mapping[str, Any]) -> list[ParameterRow]:
    """A row for every parameter of metrics.json: those of the table in its order, then any others."""
    specs = {spec.name: spec for spec in ARTIST_PARAMETERS}
    known = [
        _row(specs[name], parameters[name], uncertainty.get(name, {})) for name in specs if name in parameters
    ]
    unknown = [
        ParameterRow(
            name, "", number(value, 4), "", "", "", None, "", "not in this version's table", "", False
        )
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
        described += f", between {number(interval[0])} and {number(interval[1])}"
    return RangeBar(
        axis.place(value),
        axis.place(float(spec.default)),
        ends,
        f"{described}; default {number(spec.default)}",
    )
