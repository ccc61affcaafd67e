"""Mitsuba's shapes as triangles in local space."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float32, Float64, Int64

from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings
from vpltune.renderer.scene.files.limits import DecodedBytes
from vpltune.renderer.scene.files.obj_scene import read_obj
from vpltune.renderer.scene.files.ply_scene import read_ply
from vpltune.renderer.scene.files.surface import Surface, finished_mesh
from vpltune.renderer.scene.mitsuba_import.plugin_tree import Plugin
from vpltune.renderer.scene.mitsuba_import.searched_folder import SearchedFolder
from vpltune.renderer.scene.scene import Mesh

# A choice: segments of a circle, and twice the rings of a sphere. 80 segments lose 0.1 % of a circle's area.
_SIDES = 80


Front = Literal["winding", "normals"]
"""The side on which the triangles wind counter-clockwise in the world, or that of the mesh's normals, which
a mirror turns with the surface: then the front of a mirrored surface winds clockwise."""


@dataclass(frozen=True, eq=False)
class Shape:
    """Triangles, and the transform from the shape's parameters that is applied before `to_world`."""

    mesh: Mesh
    """The same object for all shapes that differ in their transform and material alone. Its material is 0."""
    to_shape: Float64[np.ndarray, "4 4"]
    """Such as the centre and radius of a sphere; the identity if there are none."""
    front: Front
    """What says on which side of the shape Mitsuba's normals point, and so its light leaves."""


class ShapeReader:
    """Gives the triangles of shapes, and reads each mesh file once.

    Args:
        folder: where mesh files are looked for.
        warnings: takes a line for each approximation.
        decoded: the memory limit.
    """

    def __init__(self, folder: SearchedFolder, warnings: Warnings, decoded: DecodedBytes) -> None:
        self._folder = folder
        self._warnings = warnings
        self._decoded = decoded
        self._made: dict[tuple[object, ...], Mesh | None] = {}
        self._fronts: dict[tuple[object, ...], Front] = {}

    def read(self, shape: Plugin) -> Shape | None:
        """The triangles of a shape; None if no triangle has area.

        The origin of texture coordinates is at the top left, as in Mitsuba and glTF.

        Raises:
            SceneFileError: the shape type is unsupported, a value is invalid, a mesh file cannot be read, or
                the memory limit is exceeded.
        """
        flat = shape.flag("face_normals", False)
        if shape.type in ("obj", "ply"):
            path = self._found(shape)
            flipped = shape.flag("flip_tex_coords", shape.type == "obj") != (shape.type == "obj")
            key: tuple[object, ...] = (shape.type, path, flipped, flat)
            if key not in self._made:
                surface, self._fronts[key] = self._from_file(shape, path, flipped, flat)
                self._made[key] = self._finished(surface, path.stem, shape)
            to_shape = np.eye(4)
        else:
            if shape.type not in _UNIT_SURFACES:
                known = ", ".join(("obj", "ply", *_UNIT_SURFACES))
                raise SceneFileError(f"{shape.where}: unsupported shape type; must be one of {known}")
            key = (shape.type, flat)
            if key not in self._made:
                surface = _UNIT_SURFACES[shape.type]()
                surface = replace(surface, normals=None) if flat else surface
                # Of all shapes, Mitsuba's sphere alone turns its normals inwards in a mirror.
                self._fronts[key] = "winding" if shape.type == "sphere" else "normals"
                self._made[key] = self._finished(surface, shape.type, shape)
            to_shape = _TO_SHAPE.get(shape.type, _as_it_is)(shape)
        mesh = self._made[key]
        return None if mesh is None else Shape(mesh, to_shape, self._fronts.get(key, "normals"))

    def _finished(self, surface: Surface | None, name: str, shape: Plugin) -> Mesh | None:
        return None if surface is None else finished_mesh(surface, name, 0, self._decoded, shape.where)

    def _found(self, shape: Plugin) -> Path:
        name = shape.text("filename")
        if not self._folder.has(name, shape.where):
            raise SceneFileError(f"{shape.where}: {name!r:.80} does not exist")
        return self._folder.found(name, shape.where)

    def _from_file(
        self, shape: Plugin, path: Path, flipped: bool, flat: bool
    ) -> tuple[Surface | None, Front]:
        name = shape.text("filename")
        reader = read_obj if shape.type == "obj" else read_ply
        said = Warnings()
        try:
            scene = reader(path, said)
        except SceneFileError as error:
            raise SceneFileError(f"{shape.where}: {name!r:.80}: {error}") from error
        for line in scene.warnings:
            # Materials in the file are not used: the scene has its own.
            if "material" not in line and "mtl" not in line and "texture" not in line:
                self._warnings.add(f"{name!r:.80}: {line}")
        if not scene.meshes:
            return None, "winding"
        surface = _joined(scene.meshes)
        if shape.type == "ply" and surface.uv is not None:
            # Our PLY reader flips v, as most programs that write PLY expect. Mitsuba does not, so undo it.
            surface = replace(surface, uv=_flipped_v(surface.uv))
        if flipped and surface.uv is not None:
            surface = replace(surface, uv=_flipped_v(surface.uv))
        if flat:
            return replace(surface, normals=None), "winding"
        # Mitsuba computes normals that a file lacks from the triangles in the world.
        return (_smoothed(surface), "winding") if _is_flat(surface) else (surface, "normals")


def wound_by_normals(mesh: Mesh) -> Mesh:
    """The mesh whose triangles all wind counter-clockwise on the side to which their normals point."""
    first, second, third = (mesh.positions[mesh.triangles[:, i]].astype(np.float64) for i in range(3))
    behind = np.einsum(
        "ti,ti->t", np.cross(second - first, third - first), mesh.normals[mesh.triangles].sum(axis=1)
    )
    if not (behind < 0.0).any():
        return mesh
    triangles = np.where((behind < 0.0)[:, None], mesh.triangles[:, ::-1], mesh.triangles)
    return replace(mesh, triangles=np.ascontiguousarray(triangles))


def _flipped_v(uv: np.ndarray) -> np.ndarray:
    return uv * np.array((1, -1), np.float32) + np.array((0, 1), np.float32)


def _joined(meshes: tuple[Mesh, ...]) -> Surface:
    starts = np.cumsum([0] + [len(mesh.positions) for mesh in meshes])
    triangles = [mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)]
    return Surface(
        np.concatenate([mesh.positions for mesh in meshes]),
        np.concatenate(triangles).astype(np.int64),
        np.concatenate([mesh.normals for mesh in meshes]),
        np.concatenate([mesh.uv for mesh in meshes]),
    )


def _is_flat(surface: Surface) -> bool:
    """Whether every corner has its triangle's normal, as our readers set it if the file has no normals."""
    normals, triangles = surface.normals, surface.triangles
    assert normals is not None
    return len(surface.positions) == triangles.size and bool(
        (normals[triangles] == normals[triangles[:, :1]]).all()
    )


def _smoothed(surface: Surface) -> Surface:
    """The surface with equal vertices merged and smooth, angle-weighted normals (Thürmer and Wüthrich 1998).

    Mitsuba does the same for files without normals. Vertices are equal if position and uv are.
    """
    assert surface.uv is not None
    keys = np.concatenate([surface.positions, surface.uv], axis=1)
    _, first, vertex = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    triangles = vertex.reshape(-1)[surface.triangles]
    corners = surface.positions[surface.triangles].astype(np.float64)
    normals = np.zeros((len(first), 3))
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face /= np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-300)
    for corner in range(3):
        to_next = corners[:, (corner + 1) % 3] - corners[:, corner]
        to_last = corners[:, (corner + 2) % 3] - corners[:, corner]
        sine = np.linalg.norm(np.cross(to_next, to_last), axis=1)
        angle = np.arctan2(sine, (to_next * to_last).sum(axis=1))
        np.add.at(normals, triangles[:, corner], angle[:, None] * face)
    return Surface(surface.positions[first], triangles, normals.astype(np.float32), surface.uv[first])


def _rectangle() -> Surface:
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], np.float64)
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    normals = np.tile((0.0, 0.0, 1.0), (4, 1))
    return _surface(corners, triangles, normals, (corners[:, :2] + 1.0) / 2.0)


def _cube() -> Surface:
    """The cube [−1, 1]³ with the texture coordinates of Mitsuba's cube."""
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float64)
    faces = np.array(
        [
            [[1, -1, -1], [1, -1, 1], [-1, -1, 1], [-1, -1, -1]],
            [[1, 1, -1], [-1, 1, -1], [-1, 1, 1], [1, 1, 1]],
            [[1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]],
            [[1, -1, 1], [1, 1, 1], [-1, 1, 1], [-1, -1, 1]],
            [[-1, -1, 1], [-1, 1, 1], [-1, 1, -1], [-1, -1, -1]],
            [[1, 1, -1], [1, -1, -1], [-1, -1, -1], [-1, 1, -1]],
        ],
        np.float64,
    )
    starts = 4 * np.arange(6)[:, None, None]
    triangles = (starts + np.array([[0, 1, 2], [3, 0, 2]])).reshape(-1, 3)
    normals = np.repeat(faces.mean(axis=1), 4, axis=0)
    return _surface(faces.reshape(-1, 3), triangles, normals, np.tile(uv, (6, 1)))


def _sphere() -> Surface:
    u, v = np.meshgrid(np.arange(_SIDES + 1) / _SIDES, np.arange(_SIDES // 2 + 1) / (_SIDES // 2))
    azimuth, polar = 2.0 * np.pi * u, np.pi * v
    points = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1
    ).reshape(-1, 3)
    uv = np.stack([u, v], axis=-1).reshape(-1, 2)
    # Rows go down and columns go left, seen from outside, so reverse the winding.
    return _surface(points, _grid(_SIDES // 2, _SIDES)[:, ::-1], points, uv)


def _disk() -> Surface:
    radius, turn = np.meshgrid([0.0, 1.0], np.arange(_SIDES + 1) / _SIDES)
    angle = 2.0 * np.pi * turn
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle], axis=-1).reshape(-1, 3)
    uv = np.stack([radius, turn], axis=-1).reshape(-1, 2)
    normals = np.tile((0.0, 0.0, 1.0), (len(points), 1))
    return _surface(points, _grid(_SIDES, 1), normals, uv)


def _cylinder() -> Surface:
    """A cylinder of radius 1 around Z from 0 to 1, open at both ends."""
    turn, height = np.meshgrid(np.arange(_SIDES + 1) / _SIDES, [0.0, 1.0])
    angle = 2.0 * np.pi * turn
    points = np.stack([np.cos(angle), np.sin(angle), height], axis=-1).reshape(-1, 3)
    uv = np.stack([turn, height], axis=-1).reshape(-1, 2)
    return _surface(points, _grid(1, _SIDES), points * (1.0, 1.0, 0.0), uv)


def _as_it_is(shape: Plugin) -> Float64[np.ndarray, "4 4"]:
    return np.eye(4)


def _center_and_radius(shape: Plugin) -> Float64[np.ndarray, "4 4"]:
    to_shape = np.diag([*[shape.number("radius", 1.0)] * 3, 1.0])
    to_shape[:3, 3] = shape.vector("center", (0.0, 0.0, 0.0))
    return _invertible(to_shape, shape)


def _from_p0_to_p1(shape: Plugin) -> Float64[np.ndarray, "4 4"]:
    start, end = shape.vector("p0", (0.0, 0.0, 0.0)), shape.vector("p1", (0.0, 0.0, 1.0))
    axis, radius = end - start, shape.number("radius", 1.0)
    length = float(np.linalg.norm(axis))
    side = np.zeros(3)
    side[np.argmin(np.abs(axis))] = 1.0
    across = np.cross(side, axis)
    across /= max(float(np.linalg.norm(across)), 1e-300)
    to_shape = np.eye(4)
    if start[0] == start[1] == end[0] == end[1] == 0.0 < end[2] - start[2]:
        across = np.array([1.0, 0.0, 0.0])
    to_shape[:3, 0], to_shape[:3, 2], to_shape[:3, 3] = radius * across, axis, start
    to_shape[:3, 1] = radius * np.cross(axis / max(length, 1e-300), across)
    return _invertible(to_shape, shape)


def _invertible(matrix: Float64[np.ndarray, "4 4"], shape: Plugin) -> Float64[np.ndarray, "4 4"]:
    if not abs(np.linalg.det(matrix[:3, :3])) > 0.0:
        raise SceneFileError(f"{shape.where}: radius and length must be above zero")
    return matrix


def _grid(rows: int, columns: int) -> Int64[np.ndarray, "triangles 3"]:
    """Triangles of a grid of (rows + 1) × (columns + 1) vertices, two for each cell."""
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1, 1)
    up = columns + 1
    return np.concatenate([first + np.array([0, 1, up + 1]), first + np.array([0, up + 1, up])]).astype(
        np.int64
    )


def _surface(
    positions: Float64[np.ndarray, "n 3"],
    triangles: Int64[np.ndarray, "t 3"],
    normals: Float64[np.ndarray, "n 3"],
    uv: Float64[np.ndarray, "n 2"],
) -> Surface:
    def single(values: np.ndarray) -> Float32[np.ndarray, "n _"]:
        return values.astype(np.float32)

    return Surface(single(positions), np.ascontiguousarray(triangles), single(normals), single(uv))


_UNIT_SURFACES: dict[str, Callable[[], Surface]] = {
    "rectangle": _rectangle,
    "cube": _cube,
    "sphere": _sphere,
    "disk": _disk,
    "cylinder": _cylinder,
}
_TO_SHAPE: dict[str, Callable[[Plugin], Float64[np.ndarray, "4 4"]]] = {
    "sphere": _center_and_radius,
    "cylinder": _from_p0_to_p1,
}
