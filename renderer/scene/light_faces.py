"""The RSM faces of lights: one for a narrow spot, five for a wide one, six for a point light, a sun's own."""

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.light_range import inverse_range
from vpltune.renderer.scene.scene import Light
from vpltune.renderer.scene.spot_cone import cone_scale
from vpltune.renderer.scene.sun_faces import SunGrid, sun_faces

KIND_CODES = {"spot": 0, "point": 1, "directional": 2}
"""Light kinds as numbers in `position_kind.w`; shaders/common/lights.glsl reads them."""

LIGHT_DTYPE = np.dtype(
    [
        ("position_kind", "f4", 4),
        ("direction_cone_scale", "f4", 4),
        ("intensity_cos_outer", "f4", 4),
        ("faces", "i4", 2),
        ("inverse_range", "f4"),
        ("padding", "f4"),
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


@dataclass(frozen=True)
class LightRecords:
    """Lights and faces in the layout that shaders/common/lights.glsl reads."""

    lights: np.ndarray
    """[lights] of `LIGHT_DTYPE`."""
    faces: np.ndarray
    """[faces] of `FACE_DTYPE`."""
    moment_origin: tuple[float, float, float]
    """Origin of the first face, world units. Sums of squared distances from it lose little precision."""


def face_count(lights: tuple[Light, ...], nested_faces: int) -> int:
    """Number of RSM faces of the lights. It depends on their kinds and cones only.

    Args:
        lights: the lights of a view.
        nested_faces: `sun_faces.nested_face_count` of the scene; 0 counts a sun as one face.
    """
    return sum(_face_count(light, nested_faces) for light in lights)


def light_records(
    lights: tuple[Light, ...],
    bounds: Float64[np.ndarray, "2 3"],
    grid: SunGrid,
    sky: tuple[Light, ...] = (),
) -> LightRecords:
    """Records of the lights and their RSM faces, for a scene within `bounds`.

    Args:
        lights: the lights of a view.
        bounds: low and high corner of the scene, world units.
        grid: what the faces of directional lights are laid out by.
        sky: directional lights that stand for parts of a sky. They come last, with one face each: what is
            near the eye needs no finer shadow of so wide a light.
    """
    every = (*lights, *sky)
    records = np.zeros(len(every), LIGHT_DTYPE)
    faces: list[np.ndarray] = []
    whole = replace(grid, nested_faces=0)
    for index, light in enumerate(every):
        own = _faces(light, index, bounds, grid if index < len(lights) else whole)
        records[index] = (
            (*light.position_world, KIND_CODES[light.kind]),
            (*light.direction_world, cone_scale(light.inner_cone, light.outer_cone)),
            (*light.intensity, math.cos(light.outer_cone)),
            (len(faces), len(own)),
            inverse_range(light),
            0.0,
        )
        faces += own
    all_faces = np.array(faces, FACE_DTYPE) if faces else np.zeros(0, FACE_DTYPE)
    origin = all_faces["light_to_world"][0, 3, :3] if faces else bounds.mean(axis=0)
    x, y, z = origin.tolist()
    return LightRecords(records, all_faces, (x, y, z))


def _face_count(light: Light, nested_faces: int) -> int:
    if light.kind == "point":
        return 6
    if light.kind == "directional":
        return 1 + nested_faces
    # A spot does not light what is behind it, so its sixth cube face would stay dark.
    return 5 if light.kind == "spot" and light.outer_cone > WIDEST_SINGLE_FACE else 1


def _faces(light: Light, index: int, bounds: np.ndarray, grid: SunGrid) -> list[np.ndarray]:
    if light.kind == "directional":
        rotation = _rotation_along(light.direction_world)
        return [
            _face(
                rotation,
                rotation @ np.array([*face.center, face.front]),
                index,
                1,
                (face.extent[0], face.extent[1]),
                face.depth,
            )
            for face in sun_faces(rotation, bounds, grid)
        ]
    near = NEAR_PLANE * float(np.linalg.norm(bounds[1] - bounds[0])) / 2.0
    count = _face_count(light, grid.nested_faces)
    if count == 1:
        tan_outer = math.tan(light.outer_cone)
        rotation = _rotation_along(light.direction_world)
        return [_face(rotation, light.position_world, index, 0, (tan_outer, tan_outer), near)]
    rotations = _CUBE
    if light.kind == "spot":
        rotations = _rotation_along(light.direction_world) @ _CUBE[:count]
    return [_face(rotation, light.position_world, index, 0, (1.0, 1.0), near) for rotation in rotations]


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
