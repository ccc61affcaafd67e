"""Views: a camera, an image size and lights, stored in `views.json` in world units."""

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.small_text import read_small_text
from vpltune.renderer.scene.files.limits import LARGEST_NUMBER, LARGEST_RADIOMETRIC
from vpltune.renderer.scene.light_range import checked_range
from vpltune.renderer.scene.scene import Camera, Light, scaled_camera, scaled_light
from vpltune.renderer.scene.spot_cone import checked_cone

Split = Literal["fitted", "validation", "held_out"]
"""What a view is for. Parameters are fitted to `fitted` views, `validation` views choose between the
candidates of a fit, and `held_out` views choose nothing: error is only measured on them."""
SPLITS: tuple[Split, ...] = get_args(Split)
"""Every value of `Split`."""
LARGEST_FILE = 1 << 24
"""A choice: most bytes of a views.json. A view takes about 1 kB, and JSON 20 times its size in memory."""


@dataclass(frozen=True, eq=False)
class View:
    """One image to render. Rays go through pixel centres; row 0 is at the top."""

    name: str
    split: Split
    size: tuple[int, int]
    """Width and height in pixels."""
    camera: Camera
    lights: tuple[Light, ...]

    def __repr__(self) -> str:
        width, height = self.size
        eye = ", ".join(f"{value:.4g}" for value in self.camera.position_world)
        lights = " + ".join(light.kind for light in self.lights) or "no light"
        return f"View({self.name!r}, {self.split}, {width}×{height}, eye ({eye}), {lights})"


def scaled_view(view: View, factor: float) -> View:
    """The view for a scene scaled by `factor`: camera and lights are scaled, the image stays the same."""
    return View(
        view.name,
        view.split,
        view.size,
        scaled_camera(view.camera, factor),
        tuple(scaled_light(light, factor) for light in view.lights),
    )


def ray_directions_world(view: View) -> Float64[np.ndarray, "height width 3"]:
    """Directions from the eye through the pixel centres, scaled to unit depth along the view axis."""
    width, height = view.size
    tan_half = math.tan(view.camera.yfov / 2.0)
    x = (2.0 * (np.arange(width) + 0.5) / width - 1.0) * tan_half * width / height
    y = (1.0 - 2.0 * (np.arange(height) + 0.5) / height) * tan_half
    directions = np.empty((height, width, 3))
    directions[..., 0] = x[None, :]
    directions[..., 1] = y[:, None]
    directions[..., 2] = -1.0
    return directions @ view.camera.to_world[:3, :3].T


def light_to_json(light: Light) -> dict[str, Any]:
    """A light in the form of `views.json`. World units, W/sr or W/m², radians.

    `range` is there only where the light ends, so the keys of references without one stay what they were.
    """
    document = {
        "type": light.kind,
        "position": light.position_world.tolist(),
        "direction": light.direction_world.tolist(),
        "intensity": light.intensity.tolist(),
        "inner_cone": light.inner_cone,
        "outer_cone": light.outer_cone,
    }
    if light.kind != "directional" and light.range < math.inf:
        document["range"] = light.range
    return document


def _view_to_json(view: View) -> dict[str, Any]:
    return {
        "name": view.name,
        "split": view.split,
        "size": np.asarray(view.size).tolist(),
        "camera": camera_to_json(view.camera),
        "lights": [light_to_json(light) for light in view.lights],
    }


def views_to_json(scene_path: str, views: tuple[View, ...]) -> dict[str, Any]:
    """The contents of `views.json`. Lengths are in world units, angles in radians."""
    return {"scene": scene_path, "views": [_view_to_json(view) for view in views]}


def write_views(path: Path, scene_path: str, views: tuple[View, ...]) -> None:
    """Write `views.json` atomically.

    Raises:
        InputError: the path cannot be written to.
    """
    write_text_whole(path, json.dumps(views_to_json(scene_path, views), indent=2) + "\n")


def read_views(path: str | Path) -> tuple[View, ...]:
    """Read `views.json`.

    Raises:
        InputError: the file cannot be read or is not JSON, or a key is missing or its value is not allowed.
    """
    text = read_small_text(Path(path), LARGEST_FILE)
    try:
        return _views(text, path)
    except RecursionError as error:
        raise InputError(f"{path}: not views.json (nested too deep)") from error


def _views(text: str, path: str | Path) -> tuple[View, ...]:
    try:
        document = json.loads(text)
    except ValueError as error:  # bad syntax, or an integer of more than 4300 digits
        raise InputError(f"{path}: not JSON ({error})") from error
    entries = document.get("views") if isinstance(document, dict) else None
    if not isinstance(entries, list) or not entries:
        raise InputError(f"{path}: key 'views' must be a list of at least one view")
    return tuple(_view_from_json(entry, f"{path}: views[{index}]") for index, entry in enumerate(entries))


def checked_view(view: View, where: str) -> View:
    """A view made in Python, held to the rules of `views.json`; a spot's hard edge is softened as there.

    Raises:
        InputError: it is no view, or a field has a value that is not allowed. `where` names it.
    """
    _require_type(view, View, where)
    _require_type(view.camera, Camera, f"{where}.camera")
    if not isinstance(view.lights, tuple | list):
        raise InputError(f"{where}.lights: must be a tuple of lights, got {type(view.lights).__name__}")
    for index, light in enumerate(view.lights):
        _require_type(light, Light, f"{where}.lights[{index}]")
    checked = _view_from_json(_view_to_json(view), where)
    # The file has no names of cameras and lights.
    lights = (replace(new, name=old.name) for new, old in zip(checked.lights, view.lights, strict=True))
    return replace(checked, camera=replace(checked.camera, name=view.camera.name), lights=tuple(lights))


def checked_camera(camera: Camera, where: str) -> Camera:
    """A camera made in Python, held to the rules of `views.json`. Raises as `checked_view`."""
    _require_type(camera, Camera, where)
    return replace(camera_from_json(camera_to_json(camera), where), name=camera.name)


def checked_light(light: Light, where: str) -> Light:
    """A light made in Python, held to the rules of `views.json`. Raises as `checked_view`."""
    _require_type(light, Light, where)
    return replace(light_from_json(light_to_json(light), where), name=light.name)


def _require_type(value: Any, kind: type, where: str) -> None:
    if not isinstance(value, kind):
        raise InputError(f"{where}: must be a {kind.__name__}, got {type(value).__name__}")


def _view_from_json(entry: Any, where: str) -> View:
    size = _numbers(entry, "size", 2, where)
    if (size < 1).any() or (size > 16384).any() or (size != np.round(size)).any():
        raise InputError(f"{where}.size: must be two whole numbers from 1 to 16384, got {size.tolist()}")
    split = _member(entry, "split", where)
    if split not in SPLITS:
        raise InputError(f"{where}.split: must be one of {', '.join(SPLITS)}, got {split!r:.60}")
    lights = _member(entry, "lights", where)
    if not isinstance(lights, list):
        raise InputError(f"{where}.lights: must be a list, got {type(lights).__name__}")
    return View(
        name=str(_member(entry, "name", where)),
        split=split,
        size=(int(size[0]), int(size[1])),
        camera=camera_from_json(_member(entry, "camera", where), f"{where}.camera"),
        lights=tuple(light_from_json(light, f"{where}.lights[{i}]") for i, light in enumerate(lights)),
    )


def camera_to_json(camera: Camera) -> dict[str, Any]:
    """A camera in the form of `views.json`. World units, radians."""
    return {"to_world": camera.to_world.ravel().tolist(), "yfov": camera.yfov}


def camera_from_json(entry: Any, where: str) -> Camera:
    """The camera that `camera_to_json` wrote; `where` names it in errors.

    Raises:
        InputError: a key is missing, or its value is not allowed.
    """
    to_world = _numbers(entry, "to_world", 16, where).reshape(4, 4)
    rotation = to_world[:3, :3]
    # 1e-4 accepts matrices printed with five digits, and rejects scale and shear.
    turns = np.abs(rotation @ rotation.T - np.eye(3)).max() <= 1e-4 and np.linalg.det(rotation) > 0.0
    if not turns or to_world[3].tolist() != [0.0, 0.0, 0.0, 1.0]:
        raise InputError(f"{where}.to_world: must be a rigid 4 × 4 matrix, row by row")
    yfov = float(_numbers(entry, "yfov", 1, where)[0])
    if not 0.0 < yfov < math.pi:
        raise InputError(f"{where}.yfov: must lie in (0, π) radians, got {yfov}")
    return Camera(to_world, yfov)


def light_from_json(entry: Any, where: str) -> Light:
    """The light that `light_to_json` wrote; `where` names it in errors.

    Raises:
        InputError: a key is missing, or its value is not allowed.
    """
    kind = _member(entry, "type", where)
    if kind not in ("spot", "point", "directional"):
        raise InputError(f"{where}.type: must be 'spot', 'point' or 'directional', got {kind!r:.60}")
    # What a point or spot light may have depends on the scene's size, and is checked with it.
    most = LARGEST_RADIOMETRIC if kind == "directional" else LARGEST_NUMBER
    intensity = _numbers(entry, "intensity", 3, where, most)
    if (intensity < 0.0).any():
        raise InputError(f"{where}.intensity: must not be negative, got {intensity.tolist()}")
    light: dict[str, Any] = {}
    if kind != "directional":
        light["position_world"] = _numbers(entry, "position", 3, where)
        if "range" in entry:
            light["range"] = checked_range(float(_numbers(entry, "range", 1, where)[0]), f"{where}.range")
    if kind != "point":
        direction = _numbers(entry, "direction", 3, where)
        length = np.linalg.norm(direction)
        if not length > 0.0:
            raise InputError(f"{where}.direction: must not be zero")
        light["direction_world"] = direction / length
    if kind == "spot":
        inner, outer = (float(_numbers(entry, key, 1, where)[0]) for key in ("inner_cone", "outer_cone"))
        light["inner_cone"], light["outer_cone"] = checked_cone(inner, outer, "radians", where)
    return Light(kind=kind, intensity=intensity, **light)


def _member(entry: Any, key: str, where: str) -> Any:
    if not isinstance(entry, dict):
        raise InputError(f"{where}: must be an object, got {type(entry).__name__}")
    if key not in entry:
        raise InputError(f"{where}: key '{key}' is missing")
    return entry[key]


def _numbers(
    entry: Any, key: str, count: int, where: str, most: float = LARGEST_NUMBER
) -> Float64[np.ndarray, " count"]:
    value = _member(entry, key, where)
    # One number is no list.
    items = [value] if count == 1 else value if isinstance(value, list) else []
    # Python's json reads 1e999 as infinity and NaN as NaN, and bool is a subclass of int.
    plain = all(isinstance(item, int | float) and not isinstance(item, bool) for item in items)
    if not plain or len(items) != count or not all(abs(item) <= most for item in items):
        raise InputError(
            f"{where}.{key}: must be {count} finite number{'s' * (count > 1)}, got {value!r:.60}; "
            f"at most {most:g} each"
        )
    return np.array(items, np.float64)
