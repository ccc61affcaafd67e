"""Progress of a batch on stderr: bars on a terminal, a line for each scene anywhere else."""

import contextlib
import sys
import time
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

from vpltune.cli.verbosity import is_quiet, one_line, say

if TYPE_CHECKING:
    from rich.progress import Progress as Bars

    from vpltune.tuner.batch.job import Job
    from vpltune.tuner.batch.time_to_finish import Forecast

STAGES = ("load", "reference", "capture", "fit", "evaluate")
"""Stages of a fit that a scene's bar counts."""


@contextlib.contextmanager
def shown_batch(workers: int) -> Iterator["SilentDisplay | LineDisplay | BarDisplay"]:
    """Display a batch that fits `workers` scenes in parallel, until the block ends."""
    from vpltune.tuner.batch.time_to_finish import Forecast

    if is_quiet():
        yield SilentDisplay()
        return
    forecast = Forecast(workers)
    if not sys.stderr.isatty():
        yield LineDisplay(forecast)
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    # The texts are file names, so markup is off.
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.fields[note]}", markup=False),
    )
    console = Console(stderr=True)
    # stdout is not redirected, because --json writes to it.
    with Progress(*columns, console=console, redirect_stdout=False, redirect_stderr=False) as bars:
        yield BarDisplay(forecast, bars)


class SilentDisplay:
    """Prints nothing, for `--quiet`."""

    def found(self, jobs: "Sequence[Job]", already_done: int) -> None:
        """Ignore the scenes to fit."""

    def happened(self, event: dict[str, Any]) -> None:
        """Ignore a scheduler's event."""


class LineDisplay:
    """Plain lines: the number of scenes, and each scene when it ends."""

    def __init__(self, forecast: "Forecast") -> None:
        self._forecast = forecast

    def found(self, jobs: "Sequence[Job]", already_done: int) -> None:
        """Print the number of scenes to fit, and of those that have a record from an earlier run."""
        self._forecast.found(jobs)
        known = f", {already_done} have a record" if already_done else ""
        say(f"{len(jobs)} scene{'s' * (len(jobs) != 1)} to tune{known}")

    def happened(self, event: dict[str, Any]) -> None:
        """Print a line if the scheduler's event ends an attempt or a scene."""
        self._forecast.happened(event, time.monotonic())
        line = ending(event)
        if line and event["event"] == "record":
            done, left = self._forecast.done, time_left(self._forecast)
            say(f"[{done}/{self._forecast.total}] {line}{left}")
        elif line:
            say(line)


class BarDisplay:
    """A bar for the batch and one for each running scene; finished scenes scroll away above."""

    def __init__(self, forecast: "Forecast", bars: "Bars") -> None:
        self._forecast = forecast
        self._bars = bars
        self._scenes: dict[str, Any] = {}

    def found(self, jobs: "Sequence[Job]", already_done: int) -> None:
        """Add the bar of the batch, with the scenes that have a record from an earlier run."""
        self._forecast.found(jobs)
        self._already_done = already_done
        self._whole = self._bars.add_task("scenes", total=len(jobs) + already_done, note="")
        self._bars.update(self._whole, completed=already_done)

    def happened(self, event: dict[str, Any]) -> None:
        """Update the bars by a scheduler's event, and print a line if it ends an attempt or a scene."""
        self._forecast.happened(event, time.monotonic())
        key = event.get("key", "")
        if event["event"] == "scene_started":
            self._scenes[key] = self._bars.add_task(event["name"][-40:], total=len(STAGES), note="")
        elif event["event"] == "stage" and key in self._scenes and event["stage"] in STAGES:
            at = STAGES.index(event["stage"]) + event["share"]
            self._bars.update(self._scenes[key], completed=at, note=event["stage"])
        elif event["event"] == "record":
            if key in self._scenes:
                self._bars.remove_task(self._scenes.pop(key))
            self._bars.advance(self._whole)
        done, all_scenes = (self._already_done + n for n in (self._forecast.done, self._forecast.total))
        self._bars.update(self._whole, note=f"{done} of {all_scenes}{time_left(self._forecast)}")
        line = ending(event)
        if line:
            self._bars.console.print(line, markup=False, highlight=False)


def ending(event: dict[str, Any]) -> str:
    """The line for a failed attempt or a finished scene; empty for other events."""
    if event["event"] == "attempt_failed":
        return one_line(f"{event['name']}: attempt {event['attempt']} failed: {event['reason']}")
    if event["event"] == "record":
        status = event.get("fit") or event["status"]
        why = "" if status in ("done", "improved") else f": {event['reason']}"
        return one_line(f"{status} {event['name']} ({event['seconds']:.1f} s){why}")
    return ""


def time_left(forecast: "Forecast") -> str:
    """The forecast in words, such as "; 3 to 5 min left"; empty if there is none yet, and at the end."""
    span = forecast.seconds_left(time.monotonic())
    if span is None or span[1] <= 0.0:
        return ""
    low, high = span
    unit, seconds = next(((u, s) for u, s in (("h", 3600), ("min", 60)) if high >= 2 * s), ("s", 1))
    first, last = round(low / seconds), max(1, round(high / seconds))
    return f"; {f'{first} to ' if first != last else ''}{last} {unit} left"
