"""Where camera and lights come from: flags, then the sidecar, then the scene file, then an automatic choice.

The sidecar is a TOML file beside the scene: `room.vpltune.toml` for `room.glb`. Lengths are in world units,
angles in degrees::

    [camera]
    eye = [3.6, 2.7, -1.7]
    look_at = [-2.0, 1.7, 0.9]
    yfov_degrees = 65.0

    [[light]]
    type = "spot"               # or "point", "directional"
    position = [0.3, 3.3, 0.2]  # not for a directional light
    look_at = [0.0, 0.0, 0.3]   # or direction = [x, y, z], in which the light travels; not for a point light
    intensity = 10.0            # W/sr (spot, point) or W/m² (directional): one number, or red, green, blue
    inner_cone_degrees = 35.0   # half angles, spot only
    outer_cone_degrees = 55.0
    range = 8.0                 # where the light ends; not for a directional light

    [sky]
    radiance = [0.5, 0.6, 1.0]  # W/(m² sr), the same in all directions: one number, or red, green, blue
    # or an equirectangular map in the scene's folder:
    # environment = "sky.exr"   # or .hdr
    # scale = 1.0               # a factor of its radiance
    # rotation = 0.0            # turns it about +Y

`light = []` asks for no lights at all.
"""

import dataclasses
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.small_text import read_small_text
from vpltune.renderer.scene.files.environment_file import ENVIRONMENT_SUFFIXES, is_environment_file
from vpltune.renderer.scene.files.limits import LARGEST_NUMBER, LARGEST_RADIOMETRIC
from vpltune.renderer.scene.light_range import checked_range
from vpltune.renderer.scene.placement.automatic_camera import default_camera, default_camera_for_lights
from vpltune.renderer.scene.placement.automatic_light import default_light
from vpltune.renderer.scene.placement.given_sky import GivenSky
from vpltune.renderer.scene.placement.own_light import has_own_light
from vpltune.renderer.scene.placement.sidecar_file import near_miss, sidecar_path
from vpltune.renderer.scene.placement.sight import lit_fraction, seen_by
from vpltune.renderer.scene.placement.subject import space_of_view
from vpltune.renderer.scene.scene import Camera, Light, LightKind, Scene
from vpltune.renderer.scene.spot_cone import checked_cone
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.working_scale import require_drawable

# A choice: vertical field of view if a camera gives none.
DEFAULT_YFOV_DEGREES = 60.0
# A choice: half angles if a spot gives none; those of an automatic light in a room.
DEFAULT_CONE_DEGREES = {"inner_cone_degrees": 35.0, "outer_cone_degrees": 55.0}
# The keys that a camera may have; any other is rejected.
CAMERA_KEYS = ("eye", "look_at", "yfov_degrees")
# The keys that each type of light may have; any other is rejected.
LIGHT_KEYS: dict[LightKind, tuple[str, ...]] = {
    "spot": ("type", "position", "direction", "look_at", "intensity", "range", *DEFAULT_CONE_DEGREES),
    "point": ("type", "position", "intensity", "range"),
    "directional": ("type", "direction", "look_at", "position", "intensity"),
}
# The keys that a sky may have.
SKY_KEYS = ("radiance", "environment", "scale", "rotation")
# A choice: largest coordinate. Scenes lie within 1e12, a sun may stand beyond; its square fits float32.
LARGEST_PLACE = 1e18
# A choice: most bytes of a sidecar, which usually has 500.
_LARGEST_FILE = 1 << 20
# A choice: if the scene file's lights reach a smaller share of the image than this, they are replaced.
LEAST_LIT = 0.005


@dataclass(frozen=True, eq=False)
class Sidecar:
    """What a sidecar gives; None for what it does not give."""

    camera: Camera | None = None
    lights: tuple[Light, ...] | None = None
    sky: GivenSky | None = None


def sidecar_of(scene_path: Path) -> Sidecar:
    """What a scene's sidecar gives, if it has one.

    Raises:
        InputError: as `read_sidecar`, or it is no file.
    """
    path = sidecar_path(scene_path)
    if path.exists() and not path.is_file():
        raise InputError(f"{path}: must be a file")  # a pipe would be waited for
    return read_sidecar(path) if path.exists() else Sidecar()


def read_sidecar(path: Path) -> Sidecar:
    """The contents of a sidecar.

    Raises:
        InputError: the file cannot be read or is not TOML, a key is unknown or missing, or a value is not
            allowed.
    """
    text = read_small_text(path, _LARGEST_FILE)
    try:
        return _parsed(text, path)
    except RecursionError as error:
        raise InputError(f"{path}: not a sidecar (nested too deep)") from error


def _parsed(text: str, path: Path) -> Sidecar:
    try:
        document = tomllib.loads(text)
    except ValueError as error:
        raise InputError(f"{path}: not TOML ({error})") from error
    _check_keys(document, ("camera", "light", "sky"), str(path))
    camera = _camera(document["camera"], f"{path}: [camera]") if "camera" in document else None
    sky = _sky(document["sky"], f"{path}: [sky]") if "sky" in document else None
    if "light" not in document:
        return Sidecar(camera, None, sky)
    entries = document["light"]
    if not isinstance(entries, list):
        raise InputError(f"{path}: lights must be written as [[light]] tables")
    lights = tuple(_light(entry, f"{path}: [[light]] {i}") for i, entry in enumerate(entries))
    return Sidecar(camera, lights, sky)


def resolve_camera_and_lights(
    scene: Scene,
    scene_path: Path,
    camera_override: Camera | None,
    light_override: tuple[Light, ...] | None,
) -> tuple[Camera, tuple[Light, ...], tuple[str, ...]]:
    """The camera and lights to use, and a note for every choice that the caller did not make.

    Args:
        scene: the scene.
        scene_path: its file, beside which the sidecar is looked for.
        camera_override: goes before any other camera.
        light_override: goes before any other lights.

    Raises:
        InputError: the sidecar exists but is invalid, a light is too strong for the scene's size, or the
            scene has no triangles.
    """
    path, found = sidecar_path(scene_path), sidecar_of(scene_path)
    notes = []
    if camera_override is None or light_override is None:
        if path.exists():
            notes.append(f"{' and '.join(_mentioned(found))} taken from {path.name}")
        elif (missed := near_miss(scene_path)) is not None:
            notes.append(f"{missed} is not read: the scene's sidecar would be {path.name}")
    source = path if light_override is None else scene_path
    camera = camera_override or found.camera
    lights = light_override if light_override is not None else found.lights
    if lights is not None and scene.triangle_count():
        require_drawable(lights, scene, str(source))
    camera, lights, more = completed_camera_and_lights(scene, scene_path, camera, lights)
    return camera, lights, (*notes, *more)


def completed_camera_and_lights(
    scene: Scene, where: Path | str, camera: Camera | None, lights: tuple[Light, ...] | None
) -> tuple[Camera, tuple[Light, ...], tuple[str, ...]]:
    """The camera and lights given, or else the scene's own, or else automatic ones; with notes.

    No light is made up where surfaces glow or there is an environment.

    Args:
        scene: the scene.
        where: its file or name, for messages.
        camera: None to choose one.
        lights: None to choose them.

    Raises:
        InputError: the scene has no triangles.
    """
    if not scene.triangle_count():
        raise InputError(f"{where}: a scene must have at least one triangle, got none")
    notes = []
    if camera is None and scene.cameras:
        camera = scene.cameras[0]
        if len(scene.cameras) > 1:
            notes.append(
                f"the scene has {len(scene.cameras)} cameras; the first one is used (--camera takes another)"
            )
    own_lights = lights is not None
    lights = lights if own_lights else scene.lights
    if camera is None:
        camera, note = default_camera_for_lights(scene, lights) if lights else default_camera(scene)
        notes.append(note)
    if own_lights or (not lights and has_own_light(scene)):
        return camera, lights, tuple(notes)
    if lights:
        space = space_of_view(scene, camera)
        sight = seen_by(space, camera)
        reaches = "light reaches" if len(lights) == 1 else "lights reach"
        # A range that ends before all that the camera sees is the file's own wish.
        endless = tuple(dataclasses.replace(light, range=math.inf) for light in lights)
        if lit_fraction(space, sight, endless) >= LEAST_LIT:
            if lit_fraction(space, sight, lights) < LEAST_LIT:
                notes.append(f"within range, the scene's {reaches} nothing the camera sees")
            return camera, lights, tuple(notes)
        notes.append(f"the scene's {reaches} nothing the camera sees")
    light, note = default_light(scene, camera)
    return camera, (light,), (*notes, note)


def _mentioned(sidecar: Sidecar) -> list[str]:
    return [name for name, value in vars(sidecar).items() if value is not None] or ["nothing"]


def _check_keys(table: Any, allowed: tuple[str, ...], where: str) -> None:
    if not isinstance(table, dict):
        raise InputError(f"{where}: must be a table, got {type(table).__name__}")
    for key in table:
        if key not in allowed:
            raise InputError(f"{where}: unknown key {key!r:.60}; known are {', '.join(allowed)}")


def _numbers(
    table: dict[str, Any], key: str, counts: tuple[int, ...], where: str, most: float = LARGEST_PLACE
) -> Float64[np.ndarray, " n"]:
    if key not in table:
        raise InputError(f"{where}: key '{key}' is missing")
    value = table[key]
    listed = isinstance(value, list)
    items = value if listed else [value]
    # TOML has inf and nan, and bool is a subclass of int.
    plain = all(isinstance(item, int | float) and not isinstance(item, bool) for item in items)
    # One number is no list: [3] would be a slip for three.
    if (
        not plain
        or len(items) not in counts
        or listed != (len(items) > 1)
        or not all(abs(item) <= most for item in items)
    ):
        wanted = " or ".join(str(count) for count in counts)
        raise InputError(
            f"{where}: '{key}' must be {wanted} finite number{'s' * (counts != (1,))}, got {value!r:.60}; "
            f"at most {most:g} each"
        )
    return np.array(items, np.float64)


def _camera(table: Any, where: str) -> Camera:
    _check_keys(table, CAMERA_KEYS, where)
    eye, target = _numbers(table, "eye", (3,), where), _numbers(table, "look_at", (3,), where)
    if not np.linalg.norm(target - eye) > 0.0:
        raise InputError(f"{where}: 'look_at' must differ from 'eye', got {eye.tolist()} twice")
    degrees = float(_numbers({"yfov_degrees": DEFAULT_YFOV_DEGREES, **table}, "yfov_degrees", (1,), where)[0])
    if not 0.0 < degrees < 180.0:
        raise InputError(f"{where}: 'yfov_degrees' must lie between 0 and 180, got {degrees:g}")
    return Camera(look_at(eye, target), math.radians(degrees))


def _sky(table: Any, where: str) -> GivenSky:
    _check_keys(table, SKY_KEYS, where)
    if ("radiance" in table) == ("environment" in table):
        raise InputError(f"{where}: must have either 'radiance' or 'environment'")
    if "radiance" in table:
        _check_keys(table, SKY_KEYS[:1], where)
        radiance = np.broadcast_to(_numbers(table, "radiance", (1, 3), where, LARGEST_RADIOMETRIC), 3)
        if (radiance < 0.0).any():
            raise InputError(f"{where}: 'radiance' must not be negative, got {radiance.tolist()}")
        red, green, blue = radiance.tolist()
        return GivenSky((red, green, blue))
    name = table["environment"]
    if not isinstance(name, str) or not is_environment_file(name):
        raise InputError(
            f"{where}: 'environment' must be a file that ends in {' or '.join(ENVIRONMENT_SUFFIXES)}, "
            f"got {name!r:.60}"
        )
    filled = {"scale": 1.0, "rotation": 0.0, **table}
    scale, rotation = (float(_numbers(filled, key, (1,), where)[0]) for key in ("scale", "rotation"))
    if scale < 0.0:
        raise InputError(f"{where}: 'scale' must not be negative, got {scale:g}")
    return GivenSky(None, name, scale, rotation)


def _light(table: Any, where: str) -> Light:
    kind = table.get("type") if isinstance(table, dict) else None
    if not isinstance(kind, str) or kind not in LIGHT_KEYS:
        raise InputError(f"{where}: 'type' must be 'spot', 'point' or 'directional', got {kind!r:.60}")
    _check_keys(table, LIGHT_KEYS[kind], where)
    # What a point or spot light may have depends on the scene's size, and is checked with it.
    most = LARGEST_RADIOMETRIC if kind == "directional" else LARGEST_NUMBER
    intensity = _numbers(table, "intensity", (1, 3), where, most)
    if (intensity < 0.0).any():
        raise InputError(f"{where}: 'intensity' must not be negative, got {intensity.tolist()}")
    placed: dict[str, Any] = {}
    if kind != "directional" or "look_at" in table:
        placed["position_world"] = _numbers(table, "position", (3,), where)
    if "range" in table:
        reach = float(_numbers(table, "range", (1,), where, LARGEST_NUMBER)[0])
        placed["range"] = checked_range(reach, f"{where}: 'range'")
    if kind != "point":
        placed["direction_world"] = _direction(table, placed.get("position_world"), where)
    if kind == "spot":
        filled = {**DEFAULT_CONE_DEGREES, **table}
        inner, outer = (float(_numbers(filled, key, (1,), where)[0]) for key in DEFAULT_CONE_DEGREES)
        placed["inner_cone"], placed["outer_cone"] = checked_cone(inner, outer, "degrees", where)
    return Light(kind, np.broadcast_to(intensity, 3).copy(), **placed)


def _direction(
    table: dict[str, Any], position: Float64[np.ndarray, "3"] | None, where: str
) -> Float64[np.ndarray, "3"]:
    if ("direction" in table) == ("look_at" in table):
        raise InputError(
            f"{where}: must have either 'direction' or 'look_at', "
            f"got {'both' if 'look_at' in table else 'neither'}"
        )
    if "direction" in table:
        direction = _numbers(table, "direction", (3,), where)
    else:
        direction = _numbers(table, "look_at", (3,), where) - position
    length = np.linalg.norm(direction)
    if not length > 0.0:
        raise InputError(f"{where}: the light's direction must not be zero")
    return direction / length
