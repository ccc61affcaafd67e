"""glTF cameras and KHR_lights_punctual lights in world space."""

import math

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.files.diagnostics import SceneFileError, label
from vpltune.renderer.scene.files.gltf_document import GltfDocument
from vpltune.renderer.scene.files.json_object import JsonObject
from vpltune.renderer.scene.files.limits import (
    ENDLESS_RANGE,
    LARGEST_NUMBER,
    LARGEST_RADIOMETRIC,
    SMALLEST_RANGE,
)
from vpltune.renderer.scene.scene import Camera, Light
from vpltune.renderer.scene.spot_cone import checked_cone
from vpltune.renderer.scene.transforms import without_scale


def read_camera(
    camera: JsonObject, to_world: Float64[np.ndarray, "4 4"], document: GltfDocument
) -> Camera | None:
    """The camera of a node; None if it is orthographic. The aspect ratio in the file is not used.

    Args:
        camera: the camera object.
        to_world: the node's transform.
        document: takes warnings.

    Raises:
        SceneFileError: a value is missing or out of range, or the node's scale leaves no view direction.
    """
    kind = camera.string("type")
    if kind == "orthographic":
        document.warnings.tally(
            "1 orthographic camera is ignored; only perspective ones are used",
            "{n} orthographic cameras are ignored; only perspective ones are used",
        )
        return None
    if kind != "perspective":
        raise SceneFileError(
            f"{camera.at('type')}: must be 'perspective' or 'orthographic', got {kind!r:.40}"
        )
    perspective = camera.required_object("perspective")
    yfov = perspective.number("yfov", low=0.0, high=math.pi)
    if not 0.0 < yfov < math.pi:
        raise SceneFileError(f"{perspective.at('yfov')}: must lie in (0, π) radians, got {yfov:g}")
    rigid = without_scale(to_world)
    if rigid is None:
        raise SceneFileError(f"{camera.where}: its node must not be scaled to zero: no direction is left")
    return Camera(rigid, yfov)


def read_light(
    light: JsonObject, to_world: Float64[np.ndarray, "4 4"], document: GltfDocument
) -> Light | None:
    """The punctual light of a node. It shines along the node's −Z; the scale does not affect intensity.

    Args:
        light: the light object.
        to_world: the node's transform.
        document: takes warnings.

    Returns:
        None if the intensity is zero.

    Raises:
        SceneFileError: a value is missing or out of range, or the node's scale leaves no direction.
    """
    kind = light.string("type")
    if kind not in ("point", "spot", "directional"):
        raise SceneFileError(
            f"{light.at('type')}: must be 'point', 'spot' or 'directional', got {kind!r:.40}"
        )
    color = light.numbers("color", 3, default=(1.0, 1.0, 1.0))
    if (color < 0.0).any():
        raise SceneFileError(f"{light.at('color')}: must not be negative, got {color.tolist()}")
    # What a point or spot light may have depends on the scene's size, and is checked once that is known.
    most = LARGEST_RADIOMETRIC if kind == "directional" else LARGEST_NUMBER
    strength = light.number("intensity", 1.0, low=0.0, high=most)
    inner, outer = _cone(light, document) if kind == "spot" else (0.0, math.pi / 4)
    reach = math.inf if kind == "directional" else _range(light)
    intensity = strength * color
    if intensity.max() > most:
        raise SceneFileError(f"{light.where}: color times intensity must be at most {most:g}")
    if not intensity.any():
        document.warnings.tally(
            "1 light has no intensity; it is left out", "{n} lights have no intensity; they are left out"
        )
        return None
    return Light(
        kind=kind,
        intensity=intensity,
        position_world=to_world[:3, 3].copy(),
        direction_world=np.array([0.0, 0.0, -1.0])
        if kind == "point"
        else -_unit(to_world[:3, 2], light.where),
        inner_cone=inner,
        outer_cone=outer,
        name=label(light.string("name", ""), light.where),
        range=reach,
    )


def _range(light: JsonObject) -> float:
    value = light.members.get("range", math.inf)
    # Exporters write a vast number for a light that does not end, such as the largest of single precision.
    if isinstance(value, float | int) and not isinstance(value, bool) and value >= ENDLESS_RANGE:
        return math.inf
    return light.number("range", low=SMALLEST_RANGE, high=ENDLESS_RANGE)


def _cone(light: JsonObject, document: GltfDocument) -> tuple[float, float]:
    spot = light.object("spot") or JsonObject({}, light.at("spot"))
    inner = spot.number("innerConeAngle", 0.0)
    outer = spot.number("outerConeAngle", math.pi / 4)
    cone = checked_cone(
        inner, outer, "radians", spot.where, ("innerConeAngle", "outerConeAngle"), error=SceneFileError
    )
    if inner == outer:
        document.warnings.tally(
            "1 spot has equal cone angles; it has a hard edge",
            "{n} spots have equal cone angles; they have hard edges",
        )
    return cone


def _unit(vector: Float64[np.ndarray, "3"], where: str) -> Float64[np.ndarray, "3"]:
    length = np.linalg.norm(vector)
    if not length > 0.0:
        raise SceneFileError(f"{where}: its node must not be scaled to zero: no direction is left")
    return vector / length
