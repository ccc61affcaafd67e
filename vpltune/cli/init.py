"""`vpltune init`: writes a scene's sidecar with the camera and the lights that would be used."""

from contextlib import suppress
from typing import Annotated

import typer

from vpltune.cli.options import JsonOption, SceneArgument
from vpltune.cli.report import Report, warn
from vpltune.renderer.errors import InputError

LEAST_ROLL = 1e-3
"""Sine of a camera's roll that is told. A choice: half a pixel at the side of an image of 1,000."""


def init(
    scene: SceneArgument,
    force: Annotated[bool, typer.Option("--force", help="Replace a sidecar that exists.")] = False,
    json: JsonOption = False,
) -> Report:
    """Write SCENE.vpltune.toml to be edited: the scene's camera, lights and sky, or automatic ones."""
    from rich.markup import escape

    from vpltune.renderer.files.atomic_file import write_text_whole
    from vpltune.renderer.scene.files import read_scene
    from vpltune.renderer.scene.placement import with_environment
    from vpltune.renderer.scene.placement.scene_sidecar import completed_camera_and_lights, sidecar_of
    from vpltune.renderer.scene.placement.sidecar_file import sidecar_path, sidecar_text

    path = sidecar_path(scene)
    if path.exists() and not force:
        raise InputError(f"{path}: exists already; --force replaces it")
    loaded = read_scene(scene)
    warn(loaded.warnings)
    sky = None
    # A new sidecar keeps the sky of the one that it replaces, unless that one cannot be read.
    with suppress(InputError):
        sky = sidecar_of(scene).sky
    if sky is not None:
        loaded = with_environment(loaded, scene)
    camera, lights, notes = completed_camera_and_lights(loaded, scene, None, None)
    warn(notes)
    if abs(camera.to_world[1, 0]) > LEAST_ROLL:
        warn(("the camera is rolled about its view axis, which a sidecar cannot say; it will be upright",))
    write_text_whole(path, sidecar_text(camera, lights, sky))
    document = {"scene": str(scene), "sidecar": str(path), "lights": len(lights), "status": "ok"}
    counted = f"{len(lights)} light{'s' * (len(lights) != 1)}"
    return Report(document, (f"wrote {escape(str(path))} (camera, {counted})",))
