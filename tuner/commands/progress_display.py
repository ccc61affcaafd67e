"""Progress of long work, on stderr: a bar on a terminal, a line per stage anywhere else."""

import contextlib
import sys
from collections.abc import Callable, Iterator

Progress = Callable[[str, float], None]
"""Called with the stage ("reference", "fit", …) and the share of it that is done, in [0, 1]."""


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
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    tasks = {}
    columns = (TextColumn("{task.description:<12}"), BarColumn(), TimeElapsedColumn())
    # Nothing else is redirected: with --json, stdout is not ours to draw on.
    with Bars(*columns, console=Console(stderr=True), redirect_stdout=False, redirect_stderr=False) as bars:

        def show(stage: str, fraction: float) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=1.0)
            bars.update(tasks[stage], completed=fraction)

        yield show


def _line_per_stage() -> Progress:
    named = set()

    def show(stage: str, fraction: float) -> None:
        if stage not in named:
            named.add(stage)
            print(f"vpltune: {stage}", file=sys.stderr, flush=True)

    return show
