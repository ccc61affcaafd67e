"""The border of every way to make a scene: what is raised within becomes one line with file and cause."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.scene.files.diagnostics import SceneFileError, one_line
from vpltune.renderer.scene.files.limits import LARGEST_COORDINATE, MAX_PLACED_VERTICES, SMALLEST_EXTENT
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.working_scale import too_strong


def read_at_border(path: Path | str, read: Callable[[], Scene]) -> Scene:
    """The scene that `read` returns, checked to have triangles and a size that can be drawn.

    Args:
        path: the file, or what else the scene comes from, for messages.
        read: reads or makes the scene.

    Raises:
        InputError: the reader, or a library below it, raised anything else than an error of its own kind.
    """
    try:
        # The readers check results for being finite, so overflow on the way needs no warning.
        with np.errstate(all="ignore"):
            scene = read()
            _check(scene)
    except (ImportError, InputError, MachineError):
        raise
    except Exception as error:
        raise InputError(one_line(f"{path}: ", 4096) + one_line(_cause(error))) from error
    return scene


def require_few_placed(scene: Scene) -> None:
    """Check how many vertices the instances place, before anything is done for each.

    Raises:
        SceneFileError: they are more than `MAX_PLACED_VERTICES`.
    """
    placed = sum(len(scene.meshes[instance.mesh].positions) for instance in scene.instances)
    if placed > MAX_PLACED_VERTICES:
        raise SceneFileError(
            f"its instances must place at most {MAX_PLACED_VERTICES:,} vertices together, got {placed:,}"
        )


def _cause(error: Exception) -> str:
    """What is wrong with the file, whatever a reader or a library below it raised."""
    if isinstance(error, SceneFileError):
        return str(error)
    if isinstance(error, MemoryError):
        return "does not fit into memory"
    if isinstance(error, RecursionError):
        return "references are nested too deep"
    return f"cannot be read ({type(error).__name__}: {error})"


def _check(scene: Scene) -> None:
    if not scene.instances:
        hints = f" ({'; '.join(scene.warnings)})" if scene.warnings else ""
        raise SceneFileError(f"the scene has no triangles{hints}")
    require_few_placed(scene)
    low, high = scene.bounds()
    if not max(np.abs(low).max(), np.abs(high).max()) <= LARGEST_COORDINATE:
        raise SceneFileError(
            f"the scene must lie within {LARGEST_COORDINATE:g} of the origin, got {low} to {high}"
        )
    extent = float(np.linalg.norm(high - low))
    if not extent >= SMALLEST_EXTENT:
        raise SceneFileError(f"the scene must be at least {SMALLEST_EXTENT:g} across, got {extent:g}")
    fault = too_strong(scene.lights, extent)
    if fault is not None:
        raise SceneFileError(fault)
