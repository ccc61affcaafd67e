"""How lights become square RSM views: one face for a narrow spot or the sun, six for everything wider."""

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
        ("light", "i4"),
        ("orthographic", "i4"),
        ("extent", "f4"),
        ("near_or_range", "f4"),
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


def light_records(lights: tuple[Light, ...], center: Float64[np.ndarray, "3"], radius: float) -> LightRecords:
    """Lay out lights and RSM faces for a scene within a sphere of `center` and `radius` (world units)."""
    records = np.zeros(len(lights), LIGHT_DTYPE)
    faces: list[np.ndarray] = []
    for index, light in enumerate(lights):
        own = _faces(light, index, center, radius)
        cos_inner, cos_outer = math.cos(light.inner_cone), math.cos(light.outer_cone)
        records[index] = (
            (*light.position_world, KIND_CODES[light.kind]),
            (*light.direction_world, 1.0 / max(cos_inner - cos_outer, 1e-6)),
            (*light.intensity, cos_outer),
            (len(faces), len(own), 0, 0),
        )
        faces += own
    all_faces = np.array(faces, FACE_DTYPE) if faces else np.zeros(0, FACE_DTYPE)
    origin = all_faces["light_to_world"][0, 3, :3] if faces else center
    return LightRecords(records, all_faces, tuple(float(value) for value in origin))


def _faces(light: Light, index: int, center: np.ndarray, radius: float) -> list[np.ndarray]:
    if light.kind == "directional":
        rotation = _rotation_along(light.direction_world)
        # One percent of room: geometry that touches the sphere must not fall on the tile's border.
        extent = radius * 1.01
        return [_face(rotation, center - light.direction_world * extent, index, 1, extent, 2.0 * extent)]
    near = NEAR_PLANE * radius
    if light.kind == "spot" and light.outer_cone <= WIDEST_SINGLE_FACE:
        rotation = _rotation_along(light.direction_world)
        return [_face(rotation, light.position_world, index, 0, math.tan(light.outer_cone), near)]
    rotations = _CUBE
    if light.kind == "spot":
        # No spot reaches behind itself: of its cube, the last face stays dark.
        rotations = _rotation_along(light.direction_world) @ _CUBE[:5]
    return [_face(rotation, light.position_world, index, 0, 1.0, near) for rotation in rotations]


def _face(
    rotation: np.ndarray, position: np.ndarray, light: int, orthographic: int, extent: float, depth: float
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
    backward = -np.asarray(direction, np.float64)
    helper = np.array([0.0, 1.0, 0.0]) if abs(backward[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    right = np.cross(helper, backward)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(backward, right), backward], axis=1)
