"""The RSM faces of lights: one for a narrow spot or the sun, five for a wide spot, six for a point light."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.scene import Light

KIND_CODES = {"spot": 0, "point": 1, "directional": 2}
"""Light kinds as numbers in `position_kind.w`; shaders/common/lights.glsl reads them."""

LIGHT_DTYPE = np.dtype(
    [
        ("position_kind", "f4", 4),
        ("direction_cone_scale", "f4", 4),
        ("intensity_cos_outer", "f4", 4),
        ("faces", "i4", 4),
    ]
)
"""A light in shaders/common/lights.glsl (std430). `faces` holds the first face and the number of faces."""
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
"""An RSM face in shaders/common/lights.glsl (std430).

`extent` is tan of the half field of view, or half the width and height in world units if the face is
orthographic. `near_or_range` is the near plane, or the depth range of an orthographic face, in world units.
"""

WIDEST_SINGLE_FACE = math.radians(60.0)
"""A choice: widest half angle of a spot that gets a single perspective face.

Beyond it, most texels of the face would go to the rim of the cone, since extent grows with tan θ.
"""

NEAR_PLANE = 1e-4
"""A choice: near plane of perspective faces and of the camera, in scene radii (half diagonals)."""

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
"""Rotations of the six cube faces, whose −Z axes are +X, −X, +Y, −Y, −Z and +Z in turn."""


SIZE_STEP = 2.0**0.125
"""A choice: ratio of consecutive sizes of a snapped face. It costs at most 1/12 of the texels per axis."""


@dataclass(frozen=True)
class FaceSnapping:
    """Snapping of an orthographic face to a world-space grid, so texels do not crawl while bounds change."""

    length: float
    """A length of the scene at rest, world units. Sizes are steps from it, so they scale with the scene."""
    cells: int
    """Grid cells along the side of a face. The face moves by whole cells."""


@dataclass(frozen=True)
class LightRecords:
    """Lights and faces in the layout that shaders/common/lights.glsl reads."""

    lights: np.ndarray
    """[lights] of `LIGHT_DTYPE`."""
    faces: np.ndarray
    """[faces] of `FACE_DTYPE`."""
    moment_origin: tuple[float, float, float]
    """Origin of the first face, world units. Sums of squared distances from it lose little precision."""


def face_count(lights: tuple[Light, ...]) -> int:
    """Number of RSM faces of the lights. It depends on their kinds and cones only."""
    return sum(_face_count(light) for light in lights)


def light_records(
    lights: tuple[Light, ...], bounds: Float64[np.ndarray, "2 3"], snapping: FaceSnapping | None = None
) -> LightRecords:
    """Records of the lights and their RSM faces, for a scene within `bounds`.

    Args:
        lights: the lights of a view.
        bounds: low and high corner of the scene, world units.
        snapping: snaps orthographic faces to a grid; None fits them tightly to `bounds`.
    """
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
    x, y, z = origin.tolist()
    return LightRecords(records, all_faces, (x, y, z))


def _face_count(light: Light) -> int:
    if light.kind == "point":
        return 6
    # A spot does not light what is behind it, so its sixth cube face would stay dark.
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
    """An orthographic face along the light that contains all of `bounds`."""
    rotation = _rotation_along(light.direction_world)
    selector = np.array([[(corner >> axis) & 1 for axis in range(3)] for corner in range(8)])
    corners = bounds[selector, np.arange(3)] @ rotation
    low, high = corners.min(axis=0), corners.max(axis=0)
    # A margin of 1 % of the diagonal: a flat scene has no depth of its own, and surfaces on the bounds must
    # not fall on the border of the tile.
    room = 0.01 * float(np.linalg.norm(high - low))
    extent = (high - low) / 2.0 + room
    front = (low + high) / 2.0
    front[2] = high[2] + room
    if snapping is not None:
        extent[:2], front[:2] = _snapped(extent[:2], front[:2], snapping)
    return _face(rotation, rotation @ front, index, 1, (extent[0], extent[1]), 2.0 * extent[2])


def _snapped(extent: np.ndarray, center: np.ndarray, snapping: FaceSnapping) -> tuple[np.ndarray, np.ndarray]:
    """The extent rounded up to a size step, and the centre rounded to the grid of that size."""
    # Rounding moves the centre by up to half a cell, which is 1/cells of the extent.
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
    """A rotation whose −Z axis is the unit vector `direction` (Frisvad 2012).

    It varies smoothly with the direction and rolls little, so the texels of a turning light turn with it.
    Every such rule has one singular direction; here it is straight up.
    """
    x, y, z = (-float(component) for component in direction)
    if y < -1.0 + 1e-9:
        return np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    # Written out because np.cross takes longer than the rest of this module in a frame.
    shear = x / (1.0 + y)
    right = (1.0 - x * shear, -x, -z * shear)
    length = math.hypot(*right)
    u, v, w = (component / length for component in right)
    return np.array([[u, y * w - z * v, x], [v, z * u - x * w, y], [w, x * v - y * u, z]])
