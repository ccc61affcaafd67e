"""Progress of long work on stderr: a bar on a terminal, lines with percent and time left anywhere else."""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

Progress = Callable[[str, float], None]
"""Called with the name of a stage ("reference", "fit", …) and the share of it that is done, in [0, 1]."""


@contextlib.contextmanager
def shown_progress() -> Iterator[Progress]:
    """Show progress until the block ends; stages appear in the order they are first named."""
    if sys.stderr.isatty():
        with _bars() as progress:
            yield progress
    else:
        yield _line_per_stage()


@contextlib.contextmanager
def _bars() -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        TaskProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.progress import Progress as Bars

    tasks: dict[str, int] = {}
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


def _finish(bars: Any, task: int) -> None:
    """End a stage: fill its bar and stop its clock."""
    bars.update(task, completed=1.0)
    bars.stop_task(task)


LINE_SECONDS = 10.0
"""Least time between two lines of a stage without a terminal. A choice."""


def _line_per_stage() -> Progress:
    """Print a line when a stage begins, then one every `LINE_SECONDS` with percent and time left."""
    begun: dict[str, float] = {}
    last_line = 0.0

    def show(stage: str, fraction: float) -> None:
        nonlocal last_line
        now = time.monotonic()
        if stage not in begun:
            begun[stage], last_line = now, now
            print(f"vpltune: {stage}", file=sys.stderr, flush=True)
        elif now - last_line >= LINE_SECONDS and 0.0 < fraction < 1.0:
            last_line = now
            left = (now - begun[stage]) * (1.0 - fraction) / fraction
            print(f"vpltune: {stage} {fraction:.0%}, {left:.0f} s left", file=sys.stderr, flush=True)

    return show
