"""`read_scene`: selects the reader for a file and checks the scene that it returns."""

import importlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings, one_line
from vpltune.renderer.scene.files.limits import LARGEST_COORDINATE, SMALLEST_EXTENT
from vpltune.renderer.scene.scene import Scene

# Module and function for each suffix. Modules are loaded on demand, so reading an OBJ does not load Draco.
_READERS = {
    ".gltf": ("gltf_scene", "read_gltf"),
    ".glb": ("gltf_scene", "read_gltf"),
    ".obj": ("obj_scene", "read_obj"),
    ".ply": ("ply_scene", "read_ply"),
}


def read_scene(path: str | Path) -> Scene:
    """Read a scene from a .gltf, .glb, .obj or .ply file.

    Files that the scene refers to must be in its folder or below; nothing is fetched. `Scene.warnings` has a
    line for each thing that is ignored or approximated.

    Raises:
        InputError: the file is invalid, unsupported or too large; one line names the file and the cause.
    """
    path = Path(path)
    try:
        read = _reader_for(path)
        # The readers check results for being finite, so overflow on the way needs no warning.
        with np.errstate(all="ignore"):
            scene = _checked(read(path, Warnings()))
    except (ImportError, InputError, MachineError):
        raise
    except Exception as error:
        raise InputError(one_line(f"{path}: ", 4096) + one_line(_cause(error))) from error
    return scene


def _cause(error: Exception) -> str:
    """What is wrong with the file, whatever a reader or a library below it raised."""
    if isinstance(error, SceneFileError):
        return str(error)
    if isinstance(error, MemoryError):
        return "does not fit into memory"
    return f"cannot be read ({type(error).__name__}: {error})"


def _reader_for(path: Path) -> Callable[[Path, Warnings], Scene]:
    suffix = path.suffix.lower()
    if suffix == ".xml":
        raise SceneFileError("Mitsuba XML is not read directly; convert it to a .glb with `vpltune import`")
    if suffix not in _READERS:
        raise SceneFileError(f"a scene must be one of {', '.join(_READERS)}, got {suffix or 'no suffix'!r}")
    module, function = _READERS[suffix]
    return getattr(importlib.import_module(f"vpltune.renderer.scene.files.{module}"), function)


def _checked(scene: Scene) -> Scene:
    """The scene, which has triangles and a size that can be drawn."""
    if not scene.instances:
        hints = f" ({'; '.join(scene.warnings)})" if scene.warnings else ""
        raise SceneFileError(f"the scene has no triangles{hints}")
    low, high = scene.bounds()
    if not max(np.abs(low).max(), np.abs(high).max()) <= LARGEST_COORDINATE:
        raise SceneFileError(
            f"the scene must lie within {LARGEST_COORDINATE:g} of the origin, got {low} to {high}"
        )
    extent = float(np.linalg.norm(high - low))
    if not extent >= SMALLEST_EXTENT:
        raise SceneFileError(f"the scene must be at least {SMALLEST_EXTENT:g} across, got {extent:g}")
    return scene
