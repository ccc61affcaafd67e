"""`vpltune import`: converts a scene of another renderer to a self-contained .glb."""

from pathlib import Path
from typing import Annotated

import typer

from vpltune.cli.options import JsonOption
from vpltune.cli.report import Report, warn
from vpltune.renderer.errors import InputError


def import_scene(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="A Mitsuba scene, .xml.", show_default=False)
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT", help="The .glb to write.")],
    json: JsonOption = False,
) -> Report:
    """Convert a Mitsuba scene to a .glb: camera, lights, diffuse materials, triangles, textures."""
    from rich.markup import escape

    if scene.suffix.lower() != ".xml":
        raise InputError(f"{scene}: a Mitsuba scene ends in .xml, got {scene.suffix or 'no suffix'!r}")
    if output.suffix.lower() != ".glb":
        raise InputError(f"{output}: the file name must end in .glb, got {output.suffix or 'no suffix'!r}")

    from vpltune.renderer.export.glb_writer import write_glb
    from vpltune.renderer.files.atomic_file import require_writable
    from vpltune.renderer.scene.mitsuba_import import read_mitsuba

    require_writable(output.parent)
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
