"""`vpltune report`: writes HTML pages for a fit or a batch."""

from pathlib import Path
from typing import Annotated

import typer

from vpltune.cli.options import JsonOption
from vpltune.cli.report import OK, PARTLY_DONE, Report, warn


def report(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="A folder that `fit` or `batch` made.", show_default=False)
    ],
    json: JsonOption = False,
) -> Report:
    """Write an HTML report: DIR/report.html for a fit; for a batch, DIR/index.html and a page per scene."""
    from rich.markup import escape

    from vpltune.cli.progress_display import shown_progress
    from vpltune.tuner.report.write_report import write_report

    with shown_progress() as progress:
        written = write_report(folder, lambda share: progress("pages", share))
    warn(written.problems)
    first, *others = written.pages
    document = {
        "pages": [str(page) for page in written.pages],
        "problems": list(written.problems),
        "status": "partly done" if written.problems else "ok",
    }
    shown = (f"wrote {escape(str(first))}" + (f" and {len(others)} pages of scenes" if others else ""),)
    return Report(document, shown, PARTLY_DONE if written.problems else OK)
