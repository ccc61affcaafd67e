"""`vpltune bench`: runs the benchmarks of a checkout."""

from typing import TYPE_CHECKING, Annotated

import typer

from vpltune.cli.options import JsonOption
from vpltune.cli.report import INTERRUPTED, OK, Report, warn
from vpltune.guard import asked_to_stop
from vpltune.renderer.errors import InputError

if TYPE_CHECKING:
    from rich.console import JustifyMethod


def bench(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A benchmark, or `all`.")] = "all",
    json: JsonOption = False,
) -> Report:
    """Run a benchmark: each row has a figure, its baseline and their ratio. Ctrl-C prints the rows so far."""
    try:
        from benchmarks import benchmark_names, run_benchmark
        from benchmarks.harness.machine import machine_description
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "benchmarks":
            raise
        raise InputError(
            "bench: the benchmarks are not part of the installed package; run this from a checkout"
        ) from error
    from vpltune.cli.progress_display import shown_progress

    known = benchmark_names()
    if name != "all" and name not in known:
        raise InputError(f"bench: NAME must be one of {', '.join([*known, 'all'])}, got {name!r:.60}")
    rows, exit_code = [], OK
    with asked_to_stop(), shown_progress() as progress:
        try:
            for chosen in known if name == "all" else (name,):
                for row in run_benchmark(chosen, progress):
                    rows.append(row)
        except KeyboardInterrupt:
            if not rows:
                raise
            exit_code = INTERRUPTED
    if exit_code:
        warn((f"interrupted after {len(rows)} row{'s' if len(rows) > 1 else ''}",))
    document = {"machine": machine_description(), "rows": [row.as_dict() for row in rows]}
    return Report(document, (document["machine"], _table(document["rows"])), exit_code)


def _table(rows: list[dict]) -> object:
    from rich.table import Table

    table = Table()
    columns: tuple[tuple[str, JustifyMethod], ...] = (
        ("", "left"),
        ("value", "right"),
        ("unit", "left"),
        ("against", "left"),
        ("its value", "right"),
        ("ratio", "right"),
    )
    for heading, justify in columns:
        # Fold names instead of cutting them: they are search terms.
        table.add_column(heading, justify=justify, overflow="fold")
    for row in rows:
        table.add_row(
            row["name"],
            _shown(row["value"], 4),
            row["unit"],
            row["against"],
            _shown(row["against_value"], 4),
            _shown(row["ratio"], 3),
        )
    return table


def _shown(number: float, digits: int) -> str:
    """A number as the table has it; a dash where there is none, as in a row that was left out."""
    return "–" if number != number else f"{number:.{digits}g}"
