"""`vpltune export`: a config in the form another program takes."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from tuner.commands.options import JsonOption
from tuner.commands.report import Report


def export(
    file: Annotated[str, typer.Argument(metavar="FILE", help="A config, or `default`.", show_default=False)],
    to: Annotated[Literal["json", "glsl"], typer.Option(help="Normalised JSON, or constants for a shader.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT", help="The file to write.")],
    json: JsonOption = False,
) -> Report:
    """Write a config as normalised JSON or as GLSL constants."""
    from rich.markup import escape

    from renderer.atomic_file import write_text_whole
    from renderer.config_export import exported
    from renderer.tuned_config import read_config

    config = read_config(file)
    write_text_whole(output, exported(config, to))
    document = {
        "output": str(output),
        "to": to,
        "parameters": config.parameters.as_dict(),
        "status": "ok",
    }
    return Report(document, (f"wrote {escape(str(output))}",))
