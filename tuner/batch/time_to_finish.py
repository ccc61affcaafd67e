"""How long a batch still takes, from the scenes that are done and the size of those that are not."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from statistics import fmean, pstdev
from typing import Any

from vpltune.tuner.batch.job import Job

FIRST_GUESS_SECONDS = 10.0
FIRST_GUESS_SECONDS_PER_MIB = 0.5
"""Of a scene, before any was done: the order of magnitude on one core at the default size."""

DEVIATIONS = 1.9
"""Standard deviations that a forecast spans to each side: the truth lies in it four times in five or more."""

LEAST_SCENES = 3
"""Done, before anything is said: two can be alike by chance."""


@dataclass
class SceneSeconds:
    """Seconds of a scene as a line over its bytes, refitted as scenes finish."""

    bytes_done: list[int] = field(default_factory=list)
    seconds_done: list[float] = field(default_factory=list)

    def add(self, input_bytes: int, seconds: float) -> None:
        """A scene of so many bytes took so long."""
        self.bytes_done.append(input_bytes)
        self.seconds_done.append(seconds)

    def expected(self, input_bytes: int) -> float:
        """Seconds that a scene of so many bytes should take; more for more bytes, and never nothing."""
        intercept, slope = self._line()
        return intercept + slope * input_bytes

    def spread(self) -> float:
        """Standard deviation of what scenes took, as a share of what was expected of them."""
        if len(self.seconds_done) < 2:
            return 1.0
        pairs = zip(self.bytes_done, self.seconds_done, strict=True)
        shares = [seconds / expected for size, seconds in pairs if (expected := self.expected(size)) > 0.0]
        return pstdev(shares, 1.0) if shares else 1.0

    def deviation_of_sum(self, sizes: Sequence[int]) -> float:
        """Standard deviation of the seconds of all of `sizes` together, the line's own doubt included.

        That of predictions from a line through n points (Draper and Smith 1998, 1.4), summed over scenes,
        with a scatter that grows with the scene.
        """
        mean = fmean(self.bytes_done)
        variance = sum((size - mean) ** 2 for size in self.bytes_done)
        away = (fmean(sizes) - mean) ** 2 / variance if variance else 0.0
        expected = [self.expected(size) for size in sizes]
        each = sum(seconds**2 for seconds in expected)
        return self.spread() * (each + sum(expected) ** 2 * (1.0 / len(self.bytes_done) + away)) ** 0.5

    def _line(self) -> tuple[float, float]:
        if not self.seconds_done:
            return FIRST_GUESS_SECONDS, FIRST_GUESS_SECONDS_PER_MIB / 2**20
        mean_bytes, mean_seconds = fmean(self.bytes_done), fmean(self.seconds_done)
        variance = sum((size - mean_bytes) ** 2 for size in self.bytes_done)
        if not variance:
            return mean_seconds, 0.0
        pairs = zip(self.bytes_done, self.seconds_done, strict=True)
        slope = sum((size - mean_bytes) * (seconds - mean_seconds) for size, seconds in pairs) / variance
        # No scene is faster for being larger, and a line through large ones must not end below zero.
        slope = min(max(slope, 0.0), mean_seconds / max(mean_bytes, 1.0))
        return mean_seconds - slope * mean_bytes, slope


def seconds_left(
    model: SceneSeconds, waiting: Iterable[int], running: Iterable[tuple[int, float]], workers: int
) -> tuple[float, float]:
    """Low and high estimate of the seconds until the last scene is done, `DEVIATIONS` to each side.

    Args:
        model: what scenes took so far.
        waiting: bytes of each scene not yet begun.
        running: bytes of each scene at work, and the seconds it has had.
        workers: how many scenes are done at a time.
    """
    waiting, running = list(waiting), list(running)
    sizes = waiting + [size for size, _ in running]
    if not sizes:
        return 0.0, 0.0
    left = [model.expected(size) for size in waiting]
    left += [max(model.expected(size) - had, 0.0) for size, had in running]
    # Shared out evenly, but for whoever gets the last scene.
    last = (1.0 - 1.0 / workers) * fmean(left)
    middle = max(sum(left) / workers + 0.5 * last, *left)
    off = DEVIATIONS * model.deviation_of_sum(sizes) / workers + model.spread() * last
    return max(middle - off, 0.0), middle + off


class Forecast:
    """Follows a batch by its events, and says when it ends. Times are those of one steady clock."""

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._model = SceneSeconds()
        self._waiting: dict[str, int] = {}
        self._running: dict[str, tuple[int, float]] = {}
        self.total = 0
        self.done = 0

    def found(self, jobs: Sequence[Job]) -> None:
        """These are to be done."""
        self._waiting = {job.key: job.input_bytes for job in jobs}
        self.total = len(jobs)

    def happened(self, event: dict[str, Any], now: float) -> None:
        """A scheduler's event, seen at `now`."""
        key = event.get("key", "")
        if event["event"] == "workers":
            self._workers = max(1, event["count"])
        elif event["event"] == "scene_started" and key in self._waiting:
            self._running[key] = (self._waiting.pop(key), now)
        elif event["event"] == "record":
            self.done += 1
            size, _ = self._running.pop(key, (self._waiting.pop(key, 0), now))
            if event["status"] != "refused":
                # All attempts at it, as far as they are known.
                self._model.add(size, event["seconds"] * event["attempts"])

    def seconds_left(self, now: float) -> tuple[float, float] | None:
        """Low and high estimate; None before three scenes were fitted."""
        if len(self._model.seconds_done) < LEAST_SCENES:
            return None
        running = [(size, now - since) for size, since in self._running.values()]
        return seconds_left(self._model, self._waiting.values(), running, self._workers)
