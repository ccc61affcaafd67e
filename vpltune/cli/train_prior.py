"""`vpltune train-prior`: learns the parameters as a function of the scene: how `--config auto` is made."""

from pathlib import Path
from typing import Annotated

import typer

from vpltune.cli.command_line import command_line
from vpltune.cli.options import JsonOption, SeedOption
from vpltune.cli.report import Report


def train_prior(
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="OUT.json", help="The config; its card goes beside it, as .md."
        ),
    ],
    library: Annotated[
        Path | None,
        typer.Argument(
            metavar="[LIBRARY]", help="A folder of scenes, or a list of them in a file.", show_default=False
        ),
    ] = None,
    generated: Annotated[
        int, typer.Option(metavar="N", min=0, max=10_000, help="How many scenes to generate.")
    ] = 32,
    seed: SeedOption = 0,
    json: JsonOption = False,
) -> Report:
    """Learn from many scenes how parameters follow from what the GPU measures; write config and card."""
    from rich.markup import escape

    from vpltune.cli.progress_display import shown_progress
    from vpltune.tuner.prior.train_prior import train_prior as train

    with shown_progress() as progress:
        document = train(library, generated, seed, output, command_line(), progress)
    shown = (f"wrote {escape(document['output'])}", f"card:  {escape(document['card'])}")
    return Report(document, shown)
