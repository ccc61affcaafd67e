"""`vpltune import`: converts a scene of another renderer to a self-contained .glb."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vpltune.cli.options import JsonOption
from vpltune.cli.report import Report, warn
from vpltune.renderer.errors import InputError

if TYPE_CHECKING:
    from vpltune.renderer.scene.environment import Environment
    from vpltune.renderer.scene.mitsuba_import.sun_sky import BakedSunSky, SunSky

ENVIRONMENT_SUFFIX = ".environment.exr"
"""What takes the place of .glb in the name of the environment's file."""


def import_scene(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="A Mitsuba scene, .xml.", show_default=False)
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="OUT", help="The .glb to write.")],
    json: JsonOption = False,
) -> Report:
    """Convert a Mitsuba scene to a .glb: camera, lights, diffuse materials, triangles, textures.

    glTF has no environments: one is written beside the .glb, and named in its sidecar.
    """
    from rich.markup import escape

    if scene.suffix.lower() != ".xml":
        raise InputError(f"{scene}: a Mitsuba scene ends in .xml, got {scene.suffix or 'no suffix'!r}")
    if output.suffix.lower() != ".glb":
        raise InputError(f"{output}: the file name must end in .glb, got {output.suffix or 'no suffix'!r}")

    from vpltune.renderer.export.glb_writer import write_glb
    from vpltune.renderer.files.atomic_file import require_writable
    from vpltune.renderer.scene.mitsuba_import import read_mitsuba
    from vpltune.renderer.scene.placement.sidecar_file import sidecar_path
    from vpltune.tuner.doctor.extras import is_installed

    require_writable(output.parent)
    loaded = read_mitsuba(scene, _baked_sun_sky if is_installed("mitsuba") else None)
    warn(loaded.warnings)
    sky = None if loaded.environment is None else _write_environment(loaded.environment, output)
    write_glb(output, loaded, notes=loaded.warnings)
    document = {
        "scene": str(scene),
        "output": str(output),
        "triangles": loaded.triangle_count(),
        "materials": len(loaded.materials),
        "textures": len(loaded.textures),
        "lights": len(loaded.lights),
        "cameras": len(loaded.cameras),
        "environment": sky,
        "approximated": list(loaded.warnings),
        "status": "ok",
    }
    shown = (
        f"wrote {escape(str(output))} ({document['triangles']:,} triangles, {document['lights']} lights, "
        f"{document['cameras']} cameras)"
    )
    beside = () if sky is None else (f"wrote {escape(sky)} and {escape(str(sidecar_path(output)))}",)
    return Report(document, (shown, *beside))


def _baked_sun_sky(model: "SunSky") -> "BakedSunSky":
    # Only scenes with such an emitter wait for Mitsuba to load.
    from vpltune.tuner.reference.sun_sky_baking import baked_sun_sky

    return baked_sun_sky(model)


def _write_environment(environment: "Environment", output: Path) -> str:
    """Write the environment beside the .glb, and name it in the .glb's sidecar; returns its path.

    A sidecar that is there keeps its camera and lights.
    """
    from vpltune.renderer.files.atomic_file import write_text_whole
    from vpltune.renderer.files.image_file import write_exr
    from vpltune.renderer.scene.placement.given_sky import GivenSky
    from vpltune.renderer.scene.placement.scene_sidecar import sidecar_of
    from vpltune.renderer.scene.placement.sidecar_file import sidecar_path, sidecar_text

    there = sidecar_of(output)
    image = output.with_suffix(ENVIRONMENT_SUFFIX)
    write_exr(image, environment.radiance)
    text = sidecar_text(there.camera, there.lights, GivenSky(file=image.name))
    write_text_whole(sidecar_path(output), text)
    return str(image)
