"""Estimate the time that a batch still takes, from the time of finished scenes and the size of the others."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from statistics import fmean, pstdev
from typing import Any

from vpltune.tuner.batch.job import Job

FIRST_GUESS_SECONDS = 10.0
"""Intercept of the line before any scene is done. A choice: the order of magnitude on one core."""
FIRST_GUESS_SECONDS_PER_MIB = 0.5
"""Slope of the line before any scene is done. A choice, like the intercept."""

DEVIATIONS = 1.9
"""Half-width of the forecast interval in standard deviations. A choice: the interval then holds the true time
in at least four of five cases."""

LEAST_SCENES = 3
"""Finished scenes before a forecast is given. A choice: two may be alike by chance."""


@dataclass
class SceneSeconds:
    """Linear regression of the seconds of a scene on its size in bytes, updated as scenes finish."""

    bytes_done: list[int] = field(default_factory=list)
    seconds_done: list[float] = field(default_factory=list)

    def add(self, input_bytes: int, seconds: float) -> None:
        """Add a finished scene."""
        self.bytes_done.append(input_bytes)
        self.seconds_done.append(seconds)

    def expected(self, input_bytes: int) -> float:
        """Expected seconds of a scene of this size; ≥ 0, and not decreasing in `input_bytes`."""
        intercept, slope = self._line()
        return intercept + slope * input_bytes

    def spread(self) -> float:
        """Standard deviation of actual ÷ expected seconds about 1; 1 before two scenes are done."""
        if len(self.seconds_done) < 2:
            return 1.0
        pairs = zip(self.bytes_done, self.seconds_done, strict=True)
        shares = [seconds / expected for size, seconds in pairs if (expected := self.expected(size)) > 0.0]
        return pstdev(shares, 1.0) if shares else 1.0

    def deviation_of_sum(self, sizes: Sequence[int]) -> float:
        """Standard deviation of the summed seconds of scenes of these sizes in bytes.

        It is the prediction error of a line through n points (Draper and Smith 1998, section 1.4), summed
        over the scenes, with a scatter proportional to the expected seconds. At least one scene must be done.
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
        # Clamp the slope: a larger scene is never expected to be faster, and the intercept must not be
        # negative.
        slope = min(max(slope, 0.0), mean_seconds / max(mean_bytes, 1.0))
        return mean_seconds - slope * mean_bytes, slope


def seconds_left(
    model: SceneSeconds, waiting: Iterable[int], running: Iterable[tuple[int, float]], workers: int
) -> tuple[float, float]:
    """Interval for the seconds until the last scene is done, `DEVIATIONS` wide to each side.

    Args:
        model: Regression over the finished scenes.
        waiting: Size in bytes of each scene that has not started.
        running: Size in bytes and elapsed seconds of each scene in progress.
        workers: Scenes that are fitted at a time.

    Returns:
        Lower and upper end, ≥ 0.
    """
    waiting, running = list(waiting), list(running)
    sizes = waiting + [size for size, _ in running]
    if not sizes:
        return 0.0, 0.0
    left = [model.expected(size) for size in waiting]
    left += [max(model.expected(size) - had, 0.0) for size, had in running]
    # The work is shared evenly, except that the worker with the last scene finishes later than the others.
    last = (1.0 - 1.0 / workers) * fmean(left)
    middle = max(sum(left) / workers + 0.5 * last, *left)
    off = DEVIATIONS * model.deviation_of_sum(sizes) / workers + model.spread() * last
    return max(middle - off, 0.0), middle + off


class Forecast:
    """Follows the events of a batch and estimates its end. All times are seconds of one monotonic clock."""

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._model = SceneSeconds()
        self._waiting: dict[str, int] = {}
        self._running: dict[str, tuple[int, float]] = {}
        self.total = 0
        self.done = 0

    def found(self, jobs: Sequence[Job]) -> None:
        """Set the jobs of the batch."""
        self._waiting = {job.key: job.input_bytes for job in jobs}
        self.total = len(jobs)

    def happened(self, event: dict[str, Any], now: float) -> None:
        """Take an event of the scheduler into account, which occurred at `now`."""
        key = event.get("key", "")
        if event["event"] == "workers":
            self._workers = max(1, event["count"])
        elif event["event"] == "scene_started" and key in self._waiting:
            self._running[key] = (self._waiting.pop(key), now)
        elif event["event"] == "record":
            self.done += 1
            size, _ = self._running.pop(key, (self._waiting.pop(key, 0), now))
            if event["status"] != "refused":
                # Estimate of all attempts: only the time of the last is known.
                self._model.add(size, event["seconds"] * event["attempts"])

    def seconds_left(self, now: float) -> tuple[float, float] | None:
        """Interval for the seconds left, see `seconds_left`; None until `LEAST_SCENES` scenes are fitted."""
        if len(self._model.seconds_done) < LEAST_SCENES:
            return None
        running = [(size, now - since) for size, since in self._running.values()]
        return seconds_left(self._model, self._waiting.values(), running, self._workers)
