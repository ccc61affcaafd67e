"""The result of a command, and how it is printed: as one JSON object, or as text and tables."""

import contextlib
import os
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from vpltune.cli.verbosity import say
from vpltune.renderer.files.strict_json import strict_json

# Exit codes of `vpltune`. DEFECT is for unexpected exceptions. 2 is typer's for wrong arguments, and
# 130 = 128 + SIGINT the shells' for Ctrl-C.
OK = 0
DEFECT = 1
BAD_INPUT = 2
MACHINE_LACKS = 3
PARTLY_DONE = 4
INTERRUPTED = 130


@dataclass(frozen=True, eq=False)
class Report:
    """The result of a command."""

    document: Mapping[str, Any]
    """Printed with `--json`."""
    shown: tuple[Any, ...]
    """Printed without `--json`: strings with rich markup, and rich tables."""
    exit_code: int = OK


@contextlib.contextmanager
def stdout_sent_to_stderr() -> Iterator[None]:
    """Send everything that is written to stdout to stderr, output of C libraries included."""
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def print_report(report: Report) -> None:
    """Print the text and tables of `report` on stdout."""
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=True)
    for item in report.shown:
        console.print(item)


def print_json(document: Mapping[str, Any]) -> None:
    """Print `document` on stdout as one JSON object; a number that is not finite becomes null."""
    print(strict_json(document), flush=True)


def warn(lines: tuple[str, ...]) -> None:
    """Print each line on stderr as a note."""
    for line in lines:
        say(line)
