"""How lights become RSM views: one face for a narrow spot or the sun, six for everything wider."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.scene import Light

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


SIZE_STEP = 2.0**0.125
"""Ratio of one size of a snapped face to the next: at most a twelfth of the texels' density is given up."""


@dataclass(frozen=True)
class FaceSnapping:
    """How an orthographic face keeps its grid in the world while bounds move."""

    length: float
    """What sizes are steps of: of the scene at rest, so that every scale of a scene has the same steps."""
    cells: int
    """Along the side of a face; it moves by whole ones."""


@dataclass(frozen=True)
class LightRecords:
    """Lights and faces as the shaders read them (shaders/common/lights.glsl)."""

    lights: np.ndarray
    faces: np.ndarray
    moment_origin: tuple[float, float, float]
    """A point near the light: sums of squared distances lose least precision from there."""


def face_count(lights: tuple[Light, ...]) -> int:
    """How many RSM faces the lights have, wherever they are."""
    return sum(_face_count(light) for light in lights)


def light_records(
    lights: tuple[Light, ...], bounds: Float64[np.ndarray, "2 3"], snapping: FaceSnapping | None = None
) -> LightRecords:
    """Lay out lights and RSM faces for a scene within `bounds` (low and high corner, world units)."""
    records = np.zeros(len(lights), LIGHT_DTYPE)
    faces: list[np.ndarray] = []
    for index, light in enumerate(lights):
        own = _faces(light, index, bounds, snapping)
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


def _face_count(light: Light) -> int:
    if light.kind == "point":
        return 6
    # No spot reaches behind itself: of its cube, the last face would stay dark.
    return 5 if light.kind == "spot" and light.outer_cone > WIDEST_SINGLE_FACE else 1


def _faces(light: Light, index: int, bounds: np.ndarray, snapping: FaceSnapping | None) -> list[np.ndarray]:
    if light.kind == "directional":
        return [_sun_face(light, index, bounds, snapping)]
    near = NEAR_PLANE * float(np.linalg.norm(bounds[1] - bounds[0])) / 2.0
    count = _face_count(light)
    if count == 1:
        tan_outer = math.tan(light.outer_cone)
        rotation = _rotation_along(light.direction_world)
        return [_face(rotation, light.position_world, index, 0, (tan_outer, tan_outer), near)]
    rotations = _CUBE
    if light.kind == "spot":
        rotations = _rotation_along(light.direction_world) @ _CUBE[:count]
    return [_face(rotation, light.position_world, index, 0, (1.0, 1.0), near) for rotation in rotations]


def _sun_face(light: Light, index: int, bounds: np.ndarray, snapping: FaceSnapping | None) -> np.ndarray:
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
    if snapping is not None:
        extent[:2], front[:2] = _snapped(extent[:2], front[:2], snapping)
    return _face(rotation, rotation @ front, index, 1, (extent[0], extent[1]), 2.0 * extent[2])


def _snapped(extent: np.ndarray, center: np.ndarray, snapping: FaceSnapping) -> tuple[np.ndarray, np.ndarray]:
    """The next larger size, and the nearest place on that size's grid about the world's origin."""
    # A place is rounded by half a cell, 1/cells of the extent.
    needed = extent * (1.0 + 1.0 / (snapping.cells - 1.0))
    steps = np.ceil(np.log(needed / snapping.length) / math.log(SIZE_STEP))
    extent = snapping.length * SIZE_STEP**steps
    cell = 2.0 * extent / snapping.cells
    return extent, np.round(center / cell) * cell


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
    """A rotation whose −Z axis is `direction` (unit).

    It follows the direction without a jump and with little roll, so that a light that turns carries its
    texels along: Frisvad 2012, with the one direction that any such rule must except straight up.
    """
    x, y, z = (-float(component) for component in direction)
    if y < -1.0 + 1e-9:
        return np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    # Written out, because np.cross takes longer than all the rest of a frame's lights.
    shear = x / (1.0 + y)
    right = (1.0 - x * shear, -x, -z * shear)
    length = math.hypot(*right)
    u, v, w = (component / length for component in right)
    return np.array([[u, y * w - z * v, x], [v, z * u - x * w, y], [w, x * v - y * u, z]])
