"""Spot, point and directional lights, and the faces of their reflective shadow maps (RSM).

docs/runtime_formulas.md, "Lights" and "RSM faces". A light is a dict as in views.json: `type`, `position`,
`direction` (the way light travels, unit), `intensity` (W/sr, or W/m² for a directional light), `inner_cone`,
`outer_cone` (half angles in radians), and `range` (world units) where its light ends.
"""

import math

import numpy as np

from examples.formulas.vectors import dot, length, unit

WIDEST_SINGLE_FACE = math.radians(60.0)
NEAR_PLANE = 1e-4
SIZE_STEP = 2.0**0.125

# Columns: right, up, back of a face. The faces look along +X, −X, +Y, −Y, −Z, +Z.
CUBE = np.array(
    [
        [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, 1, 0], [0, 0, -1]],
    ],
    np.float64,
)


def cone_falloff(light: dict, from_light: np.ndarray) -> np.ndarray:
    """Share of the intensity in a unit direction away from the light (KHR_lights_punctual)."""
    if light["type"] != "spot":
        return np.ones(from_light.shape[:-1])
    cos_inner, cos_outer = math.cos(light["inner_cone"]), math.cos(light["outer_cone"])
    cosine = dot(from_light, light["direction"])
    return np.clip((cosine - cos_outer) / max(cos_inner - cos_outer, 1e-6), 0.0, 1.0) ** 2


def range_falloff(light: dict, distance: np.ndarray) -> np.ndarray:
    """Share of the light that is left at a distance (KHR_lights_punctual)."""
    return np.maximum(1.0 - (distance / light.get("range", math.inf)) ** 4, 0.0)


def towards_light(light: dict, position: np.ndarray) -> np.ndarray:
    """Unit vectors from points to the light."""
    if light["type"] == "directional":
        return np.broadcast_to(-np.asarray(light["direction"]), position.shape)
    return unit(light["position"] - position)


def facing_irradiance(light: dict, position: np.ndarray) -> np.ndarray:
    """Irradiance [W/m²] on a surface square to the light, without shadow."""
    intensity = np.asarray(light["intensity"], np.float64)
    if light["type"] == "directional":
        return np.broadcast_to(intensity, position.shape)
    from_light = position - np.asarray(light["position"])
    left = cone_falloff(light, unit(from_light)) * range_falloff(light, length(from_light))
    return intensity * (left / dot(from_light, from_light))[..., None]


def rotation_along(direction: np.ndarray) -> np.ndarray:
    """Columns right, up, back, with back = −direction (Frisvad 2012)."""
    x, y, z = -np.asarray(direction, np.float64)
    if y < -1.0 + 1e-9:
        return np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    right = unit(np.array([1.0 - x * x / (1.0 + y), -x, -x * z / (1.0 + y)]))
    back = np.array([x, y, z])
    return np.stack([right, np.cross(back, right), back], axis=1)


def light_faces(light: dict, bounds: np.ndarray, rest_bounds: np.ndarray, resolution: int) -> list[dict]:
    """The faces of a light for a scene within `bounds`, [2, 3]; `rest_bounds` are the scene's at rest."""
    if light["type"] == "directional":
        return [_sun_face(light, bounds, float(length(rest_bounds[1] - rest_bounds[0])), resolution)]
    near = NEAR_PLANE * float(length(bounds[1] - bounds[0])) / 2.0
    along = rotation_along(light["direction"]) if light["type"] == "spot" else np.eye(3)
    if light["type"] == "spot" and light["outer_cone"] <= WIDEST_SINGLE_FACE:
        tan_outer = math.tan(light["outer_cone"])
        return [_face(along, light["position"], (tan_outer, tan_outer), near, False)]
    # A spot gives nothing behind itself: its cube has no sixth face.
    cube = CUBE[:5] if light["type"] == "spot" else CUBE
    return [_face(along @ rotation, light["position"], (1.0, 1.0), near, False) for rotation in cube]


def _sun_face(light: dict, bounds: np.ndarray, rest_diagonal: float, resolution: int) -> dict:
    rotation = rotation_along(light["direction"])
    corners = np.array([[bounds[(i >> axis) & 1, axis] for axis in range(3)] for i in range(8)]) @ rotation
    low, high = corners.min(axis=0), corners.max(axis=0)
    room = 0.01 * length(high - low)
    extent, center = (high - low) / 2.0 + room, (low + high) / 2.0
    # The grid stays in the world while bounds move: sizes go in steps, places by whole texels.
    needed = extent[:2] * (1.0 + 1.0 / (resolution - 1.0))
    steps = np.ceil(np.log(needed / rest_diagonal) / math.log(SIZE_STEP))
    snapped = rest_diagonal * SIZE_STEP**steps
    texel = 2.0 * snapped / resolution
    center[:2] = np.round(center[:2] / texel) * texel
    origin = rotation @ np.array([*center[:2], high[2] + room])
    return _face(rotation, origin, (snapped[0], snapped[1]), 2.0 * extent[2], True)


def _face(rotation, position, extent, near_or_range: float, orthographic: bool) -> dict:
    to_world = np.eye(4)
    to_world[:3, :3], to_world[:3, 3] = rotation, position
    return {
        "light_to_world": to_world,
        "extent": np.array(extent),
        "near_or_range": near_or_range,
        "orthographic": orthographic,
    }
