"""Where a scene's environment comes from: flags, then the sidecar, then the scene file."""

from dataclasses import replace
from pathlib import Path

from vpltune.renderer.scene.placement.given_sky import GivenSky
from vpltune.renderer.scene.placement.scene_sidecar import sidecar_of
from vpltune.renderer.scene.placement.sidecar_file import sidecar_path
from vpltune.renderer.scene.scene import Scene


def with_environment(scene: Scene, scene_path: Path | None, given: GivenSky | None = None) -> Scene:
    """The scene with the environment that it is to have.

    Args:
        scene: as it was read; its own environment goes last.
        scene_path: its file, whose sidecar goes next; None for a scene in memory, which has no sidecar.
        given: goes first, such as by flags. None if nothing is given.

    Raises:
        InputError: the sidecar, or the environment's file, cannot be used.
    """
    if given is not None:
        return replace(scene, environment=given.environment(None, "--environment"))
    sky = None if scene_path is None else sidecar_of(scene_path).sky
    if sky is None:
        return scene
    assert scene_path is not None
    return replace(scene, environment=sky.environment(scene_path, f"{sidecar_path(scene_path)}: [sky]"))
