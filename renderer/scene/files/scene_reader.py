"""`read_scene`: selects the reader for a file."""

import importlib
from collections.abc import Callable
from pathlib import Path

from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings
from vpltune.renderer.scene.files.reading_border import read_at_border
from vpltune.renderer.scene.scene import Scene

# Module and function for each suffix. Modules are loaded on demand, so reading an OBJ does not load Draco.
_READERS = {
    ".gltf": ("gltf_scene", "read_gltf"),
    ".glb": ("gltf_scene", "read_gltf"),
    ".obj": ("obj_scene", "read_obj"),
    ".ply": ("ply_scene", "read_ply"),
}
SCENE_SUFFIXES = tuple(_READERS)
"""Suffixes of the files that `read_scene` reads."""


def read_scene(path: str | Path) -> Scene:
    """Read a scene from a .gltf, .glb, .obj or .ply file.

    Files that the scene refers to must be in its folder or below; nothing is fetched. `Scene.warnings` has a
    line for each thing that is ignored or approximated. What the sidecar beside the file says of camera,
    lights and sky is not part of it: `vpltune.fit` and the commands look there, and
    `vpltune.renderer.scene.placement.with_environment` gives a scene the sidecar's sky.

    Raises:
        InputError: the file is invalid, unsupported or too large; one line names the file and the cause.
    """
    path = Path(path)
    return read_at_border(path, lambda: _reader_for(path)(path, Warnings()))


def _reader_for(path: Path) -> Callable[[Path, Warnings], Scene]:
    suffix = path.suffix.lower()
    if suffix == ".xml":
        raise SceneFileError("Mitsuba XML is not read directly; convert it to a .glb with `vpltune import`")
    if suffix not in _READERS:
        raise SceneFileError(
            f"a scene must be one of {', '.join(SCENE_SUFFIXES)}, got {suffix or 'no suffix'!r}"
        )
    module, function = _READERS[suffix]
    return getattr(importlib.import_module(f"vpltune.renderer.scene.files.{module}"), function)
