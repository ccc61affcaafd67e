"""The name and the text of a scene's sidecar, `room.vpltune.toml` for `room.glb`."""

import difflib
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.files.scene_reader import SCENE_SUFFIXES
from vpltune.renderer.scene.scene import Camera, Light

SIDECAR_SUFFIX = ".vpltune.toml"
"""What takes the place of the scene's own suffix."""
# A choice: names and suffixes that are at least this alike (Ratcliff and Obershelp 1988) are taken for slips.
_ALIKE = 0.85


def sidecar_path(scene_path: Path) -> Path:
    """The path of a scene's sidecar, whether or not the file exists."""
    return Path(scene_path).with_suffix(SIDECAR_SUFFIX)


def near_miss(scene_path: Path) -> str | None:
    """The name of a file beside the scene that seems meant as its sidecar, or None.

    Such as Room.vpltune.toml, room.vpltune.tml or room.glb.vpltune.toml for room.glb. Sidecars of other
    scenes are passed over.
    """
    right = sidecar_path(scene_path)
    try:
        names = sorted(file.name for file in right.parent.iterdir())
    except OSError:
        return None
    stems = {Path(name).stem for name in names if name.lower().endswith(SCENE_SUFFIXES)}
    return next((name for name in names if name != right.name and _is_slip(name, right, stems)), None)


def _is_slip(name: str, right: Path, stems: set[str]) -> bool:
    lower, stem = name.lower(), right.name.removesuffix(SIDECAR_SUFFIX)
    first, found, last = lower.partition(".vpl")
    if not found:
        return lower == f"{stem.lower()}.toml"
    is_text = ".toml" in last or last.count(".") == 0 or _alike(Path(lower).suffix, ".toml")
    if not is_text or (name.endswith(SIDECAR_SUFFIX) and name.removesuffix(SIDECAR_SUFFIX) in stems - {stem}):
        return False
    for suffix in SCENE_SUFFIXES:
        first = first.removesuffix(suffix)
    return first == stem.lower() or (len(stem) > 3 and _alike(first, stem.lower()))


def _alike(one: str, other: str) -> bool:
    return difflib.SequenceMatcher(None, one, other).ratio() >= _ALIKE


def sidecar_text(camera: Camera, lights: Sequence[Light]) -> str:
    """A sidecar with these.

    Args:
        camera: a roll about its view axis is lost, since a sidecar's camera has +Y up.
        lights: at least one.
    """
    eye = camera.position_world
    # A target about as far away as the origin keeps its digits.
    target = eye - camera.to_world[:3, 2] * max(1.0, float(abs(eye).max()))
    parts = [
        "# Lengths in world units, angles in degrees. What is left out is chosen by VPLtune.",
        "[camera]",
        f"eye = {_numbers(eye)}",
        f"look_at = {_numbers(target)}",
        f"yfov_degrees = {_number(math.degrees(camera.yfov))}",
    ]
    for light in lights:
        unit = "W/m²" if light.kind == "directional" else "W/sr"
        parts += ["", "[[light]]", f'type = "{light.kind}"']
        if light.kind != "directional":
            parts.append(f"position = {_numbers(light.position_world)}")
        if light.kind != "point":
            parts.append(f"direction = {_numbers(light.direction_world)}")
        parts.append(f"intensity = {_numbers(light.intensity)}  # {unit}: red, green, blue")
        if light.kind == "spot":
            parts.append(f"inner_cone_degrees = {_number(math.degrees(light.inner_cone))}  # half angles")
            parts.append(f"outer_cone_degrees = {_number(math.degrees(light.outer_cone))}")
    return "\n".join(parts) + "\n"


def _numbers(values: Float64[np.ndarray, "3"]) -> str:
    return f"[{', '.join(_number(float(value)) for value in values)}]"


def _number(value: float) -> str:
    # + 0.0 turns −0 into 0.
    return f"{value + 0.0:.15g}"
