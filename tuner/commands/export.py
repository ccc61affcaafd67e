"""`vpltune export`: a config in the form another program takes."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from renderer.errors import InputError
from tuner.commands.options import JsonOption
from tuner.commands.report import Report

if TYPE_CHECKING:
    from renderer.tuned_config import TunedConfig

Form = Literal["json", "glsl", "c", "std140", "gltf"]


def export(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE", help="A config, a glTF file that carries one, or `default`.", show_default=False
        ),
    ],
    to: Annotated[
        Form,
        typer.Option(
            help="Normalised JSON; GLSL constants or uniform block; a C header; the bytes of that block; the "
            "extras of a copy of --scene."
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT", help="The file to write.")],
    scene: Annotated[
        Path | None,
        typer.Option(metavar="SCENE", help="gltf: the .gltf or .glb to copy.", show_default=False),
    ] = None,
    json: JsonOption = False,
) -> Report:
    """Write a config for another program: as text, as bytes, or into a glTF scene."""
    from rich.markup import escape

    from renderer.tuned_config import read_config

    needs_scene = to == "gltf"
    if needs_scene and scene is None:
        raise InputError(f"--scene: must be given with --to {to}")
    if not needs_scene and scene is not None:
        raise InputError(f"--scene: --to {to} takes none")
    config = read_config(file)
    _write(config, to, output, scene)
    document = {
        "output": str(output),
        "to": to,
        "parameters": config.parameters.as_dict(),
        "status": "ok",
    }
    return Report(document, (f"wrote {escape(str(output))}",))


def _write(config: "TunedConfig", to: Form, output: Path, scene: Path | None) -> None:
    import json

    from renderer.atomic_file import written_whole
    from renderer.config_export import exported
    from renderer.gltf_extras import write_gltf_extras
    from renderer.tuned_config import config_text

    if to == "gltf":
        assert scene is not None
        write_gltf_extras(scene, output, json.loads(config_text(config)))
        return
    content = exported(config, to)
    with written_whole(output) as temporary:
        temporary.write_bytes(content)
