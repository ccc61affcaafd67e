"""Progress of long work on stderr: a bar on a terminal, lines with percent and time left anywhere else."""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from vpltune.cli.verbosity import detail, is_quiet, is_verbose, say

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from rich.progress import TaskID

Progress = Callable[[str, float], None]
"""Called with the name of a stage ("reference", "fit", …) and the share of it that is done, in [0, 1]."""


@contextlib.contextmanager
def shown_progress() -> Iterator[Progress]:
    """Show progress until the block ends; stages appear in the order they are first named."""
    if is_quiet():
        yield lambda stage, fraction: None
    elif sys.stderr.isatty():
        with _bars() as progress:
            yield progress
    else:
        begun: dict[str, float] = {}
        yield _line_per_stage(begun)
        _tell_seconds(begun)


@contextlib.contextmanager
def _bars() -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        TaskID,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.progress import Progress as Bars

    tasks: dict[str, TaskID] = {}
    columns = (
        TextColumn("{task.description:<12}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    # stdout is not redirected, because --json writes to it.
    with Bars(*columns, console=Console(stderr=True), redirect_stdout=False, redirect_stderr=False) as bars:

        def show(stage: str, fraction: float) -> None:
            if stage not in tasks:
                for done in tasks.values():
                    _finish(bars, done)
                tasks[stage] = bars.add_task(stage, total=1.0)
            bars.update(tasks[stage], completed=fraction)
            if fraction >= 1.0:
                _finish(bars, tasks[stage])

        yield show
        for done in tasks.values():
            _finish(bars, done)


def _finish(bars: "Bars", task: "TaskID") -> None:
    """End a stage: fill its bar and stop its clock."""
    bars.update(task, completed=1.0)
    bars.stop_task(task)


LINE_SECONDS = 10.0
"""Least time between two lines of a stage without a terminal. A choice."""


def _line_per_stage(begun: dict[str, float]) -> Progress:
    """Print a line when a stage begins, then one every `LINE_SECONDS` with percent and time left.

    The time at which each stage began is put into `begun`.
    """
    last_line = 0.0

    def show(stage: str, fraction: float) -> None:
        nonlocal last_line
        now = time.monotonic()
        if stage not in begun:
            begun[stage], last_line = now, now
            say(stage)
        elif now - last_line >= LINE_SECONDS and 0.0 < fraction < 1.0:
            last_line = now
            left = (now - begun[stage]) * (1.0 - fraction) / fraction
            say(f"{stage} {fraction:.0%}, {left:.0f} s left")

    return show


def _tell_seconds(begun: dict[str, float]) -> None:
    """Print how long each stage took, with `--verbose`; a stage ends when the next one begins."""
    if begun and is_verbose():
        ends = [*list(begun.values())[1:], time.monotonic()]
        for (stage, start), end in zip(begun.items(), ends, strict=True):
            detail(f"{stage} took {end - start:.2f} s")
