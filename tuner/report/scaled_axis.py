"""Axes of a chart: from a value to its position, and which values get a tick."""

import math
from dataclasses import dataclass

from vpltune.renderer.config.artist_parameters import Scale

Tick = tuple[float, str]
"""Position of a tick, and its label."""


@dataclass(frozen=True)
class Axis:
    """Maps values from `low` to `high` to positions from `start` to `stop`.

    `low` and `high` must differ; a log axis needs low > 0.
    """

    low: float
    high: float
    start: float
    stop: float
    scale: Scale = "linear"

    def place(self, value: float | int) -> float:
        """The position of `value`, clamped to the axis."""
        return round(self.start + (self.stop - self.start) * self.share(value), 2)

    def share(self, value: float | int) -> float:
        """The position of `value` as a share of the axis, in [0, 1]."""
        inside = min(max(value, self.low), self.high)
        low, high, at = (self._unit(end) for end in (self.low, self.high, inside))
        return (at - low) / (high - low)

    def ticks(self, about: int = 5) -> list[float]:
        """Roughly `about` round values within the axis."""
        if self.scale == "log":
            return self._log_ticks(about)
        step = _round_step((self.high - self.low) / about)
        first = math.ceil(self.low / step - 1e-9)
        return [index * step for index in range(first, math.floor(self.high / step + 1e-9) + 1)]

    def _log_ticks(self, about: int) -> list[float]:
        low, high = math.floor(math.log10(self.low)), math.ceil(math.log10(self.high))
        decades = high - low
        mantissas = (1, 2, 5) if decades <= 2 else (1, 3) if decades <= 4 else (1,)
        stride = max(1, round(decades / about))
        candidates = [m * 10.0**exponent for exponent in range(low, high + 1, stride) for m in mantissas]
        inside = [value for value in candidates if self.low * (1 - 1e-9) <= value <= self.high * (1 + 1e-9)]
        return inside if len(inside) >= 2 else [self.low, self.high]

    def _unit(self, value: float | int) -> float:
        return math.log(value) if self.scale == "log" else float(value)


def axis_around(values: list[float], start: float, stop: float, scale: Scale = "linear") -> Axis:
    """An axis that holds all `values` with a margin. A linear axis starts at 0 if no value is negative."""
    low, high = min(values), max(values)
    if scale == "log":
        room = max((high / low) ** 0.06, 1.05)
        return Axis(low / room, high * room, start, stop, "log")
    low = min(low, 0.0)
    return Axis(low, high + 0.06 * (high - low) if high > low else low + 1.0, start, stop)


def _round_step(step: float) -> float:
    power = 10.0 ** math.floor(math.log10(step))
    return next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= step * (1.0 - 1e-9))
