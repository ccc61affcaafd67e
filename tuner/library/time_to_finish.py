"""How long a batch still takes, from the scenes that are done and the size of those that are not."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from statistics import fmean, pstdev
from typing import Any

from tuner.library.job import Job

FIRST_GUESS_SECONDS = 10.0
FIRST_GUESS_SECONDS_PER_MIB = 0.5
"""Of a scene, before any was done: the order of magnitude on one core at the default size."""


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
        """Standard deviation of what scenes took about what was expected of them, in seconds."""
        if len(self.seconds_done) < 2:
            return self.expected(0)
        pairs = zip(self.bytes_done, self.seconds_done, strict=True)
        return pstdev([seconds - self.expected(size) for size, seconds in pairs])

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
    """Low and high estimate of the seconds until the last scene is done, about two deviations apart each way.

    Args:
        model: what scenes took so far.
        waiting: bytes of each scene not yet begun.
        running: bytes of each scene at work, and the seconds it has had.
        workers: how many scenes are done at a time.
    """
    spread = model.spread()
    begun = [max(model.expected(size) - had, 0.0) for size, had in running]
    to_come = [model.expected(size) for size in waiting]
    count = len(begun) + len(to_come)
    if not count:
        return 0.0, 0.0
    share = (sum(begun) + sum(to_come)) / workers
    middle = max(share, max(begun + to_come))
    # Deviations of scenes average out over a worker's share of them; that of the last one does not.
    off = 2.0 * spread * max(1.0, (count / workers) ** 0.5)
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
        if event["event"] == "scene_started" and key in self._waiting:
            self._running[key] = (self._waiting.pop(key), now)
        elif event["event"] == "record":
            self.done += 1
            size, _ = self._running.pop(key, (self._waiting.pop(key, 0), now))
            if event["status"] != "refused":
                # All attempts at it, as far as they are known.
                self._model.add(size, event["seconds"] * event["attempts"])

    def seconds_left(self, now: float) -> tuple[float, float] | None:
        """Low and high estimate; None before two scenes were fitted."""
        if len(self._model.seconds_done) < 2:
            return None
        running = [(size, now - since) for size, since in self._running.values()]
        return seconds_left(self._model, self._waiting.values(), running, self._workers)
