"""`vpltune report`: a page to look at, for a fit or for a library of them."""

from pathlib import Path
from typing import Annotated

import typer

from tuner.commands.options import JsonOption
from tuner.commands.report import Report


def report(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="A folder that `fit` made.", show_default=False)
    ],
    json: JsonOption = False,
) -> Report:
    """Write DIR/report.html: pictures before and after, error maps, parameters, timings, in one file."""
    from rich.markup import escape

    from tuner.report_page.write_report import write_report

    pages = write_report(folder)
    document = {"pages": [str(page) for page in pages], "status": "ok"}
    return Report(document, tuple(f"wrote {escape(str(page))}" for page in pages))
