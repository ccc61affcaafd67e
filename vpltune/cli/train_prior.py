"""`vpltune train-prior`: trains the prior of `--config auto`, which predicts parameters from a scene."""

from pathlib import Path
from typing import Annotated

import typer

from vpltune.cli.command_line import command_line
from vpltune.cli.options import JsonOption, SeedOption
from vpltune.cli.report import Report


def train_prior(
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="OUT.json", help="Config to write; its model card is OUT.md."),
    ],
    library: Annotated[
        Path | None,
        typer.Argument(
            metavar="[LIBRARY]", help="A folder of scenes, or a file with one per line.", show_default=False
        ),
    ] = None,
    generated: Annotated[
        int, typer.Option(metavar="N", min=0, max=10_000, help="Number of scenes to generate.")
    ] = 32,
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> Report:
    """Train the prior of `--config auto` on many scenes; write a config and its model card."""
    from rich.markup import escape

    from vpltune.cli.progress_display import shown_progress
    from vpltune.renderer.files.atomic_file import require_writable
    from vpltune.tuner.prior.train_prior import train_prior as train

    require_writable(output.parent)
    with shown_progress() as progress:
        document = train(library, generated, seed, output, command_line(), progress)
    shown = (f"wrote {escape(document['output'])}", f"card:  {escape(document['card'])}")
    return Report(document, shown)
