"""The name and the text of a scene's sidecar, `room.vpltune.toml` for `room.glb`."""

import difflib
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.files.scene_reader import SCENE_SUFFIXES
from vpltune.renderer.scene.placement.given_sky import GivenSky
from vpltune.renderer.scene.scene import Camera, Light

SIDECAR_SUFFIX = ".vpltune.toml"
"""What takes the place of the scene's own suffix."""
# A choice: names and suffixes that are at least this alike (Ratcliff and Obershelp 1988) are taken for slips.
_ALIKE = 0.85
# A choice: most names of a folder that every one of its scenes is compared with.
_MOST_OTHER = 100


def sidecar_path(scene_path: Path) -> Path:
    """The path of a scene's sidecar, whether or not the file exists."""
    return Path(scene_path).with_suffix(SIDECAR_SUFFIX)


def near_miss(scene_path: Path) -> str | None:
    """The name of a file beside the scene that seems meant as its sidecar, or None.

    Such as Room.vpltune.toml, room.vpltune.tml or room.glb.vpltune.toml for room.glb. Sidecars of other
    scenes are passed over. A folder is listed once for all its scenes.
    """
    right = sidecar_path(scene_path)
    stem = right.name.removesuffix(SIDECAR_SUFFIX).lower()
    try:
        slips = _slips(right.parent, right.parent.stat().st_mtime_ns)
    except OSError:
        return None
    meant = [name for name in slips.by_stem.get(stem, ()) if name != right.name]
    if not meant and len(stem) > 3:
        meant = [name for guess, name in slips.other if name != right.name and _alike(guess, stem)]
    return meant[0] if meant else None


@dataclass(frozen=True, eq=False)
class _Slips:
    """The files of a folder that look like sidecars, and are that of none of its scenes."""

    by_stem: dict[str, list[str]]
    """By the lower-case stem of the scene that they seem to be for."""
    other: list[tuple[str, str]]
    """Stem and name of those for which there is no scene of this stem."""


@lru_cache(maxsize=1)
def _slips(folder: Path, changed_ns: int) -> _Slips:
    """Those of a folder that was last changed at this time."""
    names = sorted(file.name for file in folder.iterdir())
    stems = {Path(name).stem for name in names if name.lower().endswith(SCENE_SUFFIXES)}
    lower_stems = {stem.lower() for stem in stems}
    slips = _Slips({}, [])
    for name in names:
        guess = _meant_stem(name)
        if guess is None or (name.endswith(SIDECAR_SUFFIX) and name.removesuffix(SIDECAR_SUFFIX) in stems):
            continue
        slips.by_stem.setdefault(guess, []).append(name)
        if guess not in lower_stems and ".vpl" in name.lower() and len(slips.other) < _MOST_OTHER:
            slips.other.append((guess, name))
    return slips


def _meant_stem(name: str) -> str | None:
    """The lower-case stem of the scene that a file seems to be the sidecar of; None if it looks like none."""
    lower = name.lower()
    first, found, last = lower.partition(".vpl")
    if not found:
        return lower.removesuffix(".toml") if lower.endswith(".toml") else None
    if ".toml" not in last and last.count(".") > 0 and not _alike(Path(lower).suffix, ".toml"):
        return None
    for suffix in SCENE_SUFFIXES:
        first = first.removesuffix(suffix)
    return first


def _alike(one: str, other: str) -> bool:
    return difflib.SequenceMatcher(None, one, other).ratio() >= _ALIKE


def sidecar_text(camera: Camera | None, lights: Sequence[Light] | None, sky: GivenSky | None = None) -> str:
    """A sidecar with these.

    Args:
        camera: a roll about its view axis is lost, since a sidecar's camera has +Y up. None to write none.
        lights: empty for a scene that is to have none. None to write none; the scene's own, or an automatic
            one, are used then.
        sky: None to write none.
    """
    parts = ["# Lengths in world units, angles in degrees. What is left out is chosen by VPLtune."]
    if lights is not None and not lights:
        parts += ["light = []  # no lights; take this line out to add [[light]] tables", ""]
    if camera is not None:
        eye = camera.position_world
        # A target about as far away as the origin keeps its digits.
        target = eye - camera.to_world[:3, 2] * max(1.0, float(abs(eye).max()))
        parts += [
            "[camera]",
            f"eye = {_numbers(eye)}",
            f"look_at = {_numbers(target)}",
            f"yfov_degrees = {_number(math.degrees(camera.yfov))}",
        ]
    for light in lights or ():
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
        if light.kind != "directional" and light.range < math.inf:
            parts.append(f"range = {_number(light.range)}")
    if sky is not None:
        parts += ["", "[sky]", *_sky_lines(sky)]
    return "\n".join(parts) + "\n"


def _sky_lines(sky: GivenSky) -> list[str]:
    if sky.radiance is not None:
        return [f"radiance = {_numbers(np.array(sky.radiance))}  # W/(m² sr): red, green, blue"]
    # A JSON string is a TOML one, if the characters beyond 16 bits are written as they are.
    lines = [f"environment = {json.dumps(sky.file, ensure_ascii=False)}"]
    if sky.scale != 1.0:
        lines.append(f"scale = {_number(sky.scale)}")
    if sky.rotation_degrees:
        lines.append(f"rotation = {_number(sky.rotation_degrees)}  # degrees about +Y")
    return lines


def _numbers(values: Float64[np.ndarray, "3"]) -> str:
    return f"[{', '.join(_number(float(value)) for value in values)}]"


def _number(value: float) -> str:
    # + 0.0 turns −0 into 0.
    return f"{value + 0.0:.15g}"
