"""`vpltune import`: a scene in another renderer's format as a self-contained .glb."""

from pathlib import Path
from typing import Annotated

import typer

from renderer.errors import InputError
from tuner.commands.options import JsonOption
from tuner.commands.report import Report, warn


def import_scene(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="A Mitsuba scene, .xml.", show_default=False)
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT", help="The .glb to write.")],
    json: JsonOption = False,
) -> Report:
    """Turn a Mitsuba scene into a .glb: camera, lights, diffuse materials, triangles, textures."""
    from rich.markup import escape

    if scene.suffix.lower() != ".xml":
        raise InputError(f"{scene}: a Mitsuba scene ends in .xml, got {scene.suffix or 'no suffix'!r}")
    if output.suffix.lower() != ".glb":
        raise InputError(f"{output}: the file name must end in .glb, got {output.suffix or 'no suffix'!r}")

    from renderer.glb_writer import write_glb
    from renderer.mitsuba_import import read_mitsuba

    loaded = read_mitsuba(scene)
    warn(loaded.warnings)
    write_glb(output, loaded, notes=loaded.warnings)
    document = {
        "scene": str(scene),
        "output": str(output),
        "triangles": loaded.triangle_count(),
        "materials": len(loaded.materials),
        "textures": len(loaded.textures),
        "lights": len(loaded.lights),
        "cameras": len(loaded.cameras),
        "approximated": list(loaded.warnings),
        "status": "ok",
    }
    shown = (
        f"wrote {escape(str(output))} ({document['triangles']:,} triangles, {document['lights']} lights, "
        f"{document['cameras']} cameras)"
    )
    return Report(document, (shown,))
