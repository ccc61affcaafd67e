"""How lights become RSM views: one face for a narrow spot or the sun, six for everything wider."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from renderer.scene import Light

KIND_CODES = {"spot": 0, "point": 1, "directional": 2}

LIGHT_DTYPE = np.dtype(
    [
        ("position_kind", "f4", 4),
        ("direction_cone_scale", "f4", 4),
        ("intensity_cos_outer", "f4", 4),
        ("faces", "i4", 4),
    ]
)
FACE_DTYPE = np.dtype(
    [
        ("light_to_world", "f4", (4, 4)),
        ("extent", "f4", 2),
        ("near_or_range", "f4"),
        ("light", "i4"),
        ("orthographic", "i4"),
        ("padding", "i4", 3),
    ]
)

WIDEST_SINGLE_FACE = math.radians(60.0)
"""Half angle up to which a spot fits one perspective face; beyond, tan θ spends the texels on the rim."""

NEAR_PLANE = 1e-4
"""Near plane of perspective faces and of the camera, in scene radii."""

_CUBE = np.array(
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
"""Rotations whose −Z axes (third columns negated) are ∓X, ∓Y, ∓Z."""


@dataclass(frozen=True)
class LightRecords:
    """Lights and faces as the shaders read them (shaders/common/lights.glsl)."""

    lights: np.ndarray
    faces: np.ndarray
    moment_origin: tuple[float, float, float]
    """A point near the light: sums of squared distances lose least precision from there."""


def light_records(lights: tuple[Light, ...], bounds: Float64[np.ndarray, "2 3"]) -> LightRecords:
    """Lay out lights and RSM faces for a scene within `bounds` (low and high corner, world units)."""
    records = np.zeros(len(lights), LIGHT_DTYPE)
    faces: list[np.ndarray] = []
    for index, light in enumerate(lights):
        own = _faces(light, index, bounds)
        cos_inner, cos_outer = math.cos(light.inner_cone), math.cos(light.outer_cone)
        records[index] = (
            (*light.position_world, KIND_CODES[light.kind]),
            (*light.direction_world, 1.0 / max(cos_inner - cos_outer, 1e-6)),
            (*light.intensity, cos_outer),
            (len(faces), len(own), 0, 0),
        )
        faces += own
    all_faces = np.array(faces, FACE_DTYPE) if faces else np.zeros(0, FACE_DTYPE)
    origin = all_faces["light_to_world"][0, 3, :3] if faces else bounds.mean(axis=0)
    return LightRecords(records, all_faces, tuple(float(value) for value in origin))


def _faces(light: Light, index: int, bounds: np.ndarray) -> list[np.ndarray]:
    if light.kind == "directional":
        return [_sun_face(light, index, bounds)]
    near = NEAR_PLANE * float(np.linalg.norm(bounds[1] - bounds[0])) / 2.0
    if light.kind == "spot" and light.outer_cone <= WIDEST_SINGLE_FACE:
        tan_outer = math.tan(light.outer_cone)
        rotation = _rotation_along(light.direction_world)
        return [_face(rotation, light.position_world, index, 0, (tan_outer, tan_outer), near)]
    rotations = _CUBE
    if light.kind == "spot":
        # No spot reaches behind itself: of its cube, the last face stays dark.
        rotations = _rotation_along(light.direction_world) @ _CUBE[:5]
    return [_face(rotation, light.position_world, index, 0, (1.0, 1.0), near) for rotation in rotations]


def _sun_face(light: Light, index: int, bounds: np.ndarray) -> np.ndarray:
    """An orthographic face that holds all of `bounds`, as seen along the light."""
    rotation = _rotation_along(light.direction_world)
    selector = np.array([[(corner >> axis) & 1 for axis in range(3)] for corner in range(8)])
    corners = bounds[selector, np.arange(3)] @ rotation
    low, high = corners.min(axis=0), corners.max(axis=0)
    # One percent of room, of the whole size: a flat scene has no depth, and what touches the bounds must
    # not fall on a tile's border.
    room = 0.01 * float(np.linalg.norm(high - low))
    extent = (high - low) / 2.0 + room
    front = (low + high) / 2.0
    front[2] = high[2] + room
    return _face(rotation, rotation @ front, index, 1, (extent[0], extent[1]), 2.0 * extent[2])


def _face(
    rotation: np.ndarray,
    position: np.ndarray,
    light: int,
    orthographic: int,
    extent: tuple[float, float],
    depth: float,
) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = position
    record = np.zeros((), FACE_DTYPE)
    record["light_to_world"] = matrix.T
    record["light"] = light
    record["orthographic"] = orthographic
    record["extent"] = extent
    record["near_or_range"] = depth
    return record


def _rotation_along(direction: np.ndarray) -> Float64[np.ndarray, "3 3"]:
    """A rotation whose −Z axis is `direction` (unit)."""
    x, y, z = (-float(component) for component in direction)
    # Right is the cross product of +Y with backward, or of +X where the light is near vertical; written out,
    # because np.cross takes longer than all the rest of a frame's lights.
    right = (z, 0.0, -x) if abs(y) < 0.9 else (0.0, -z, y)
    length = math.hypot(*right)
    u, v, w = (component / length for component in right)
    return np.array([[u, y * w - z * v, x], [v, z * u - x * w, y], [w, x * v - y * u, z]])
