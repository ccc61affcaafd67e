"""Triangles made fit to be lit: none without area, none out of range, a unit normal at every corner."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.limits import LARGEST_COORDINATE, DecodedBytes
from vpltune.renderer.scene.scene import Mesh
from vpltune.renderer.scene.scene_animation import Skinning

# Triangles at a time: bounds the float64 temporaries of a large mesh to about 100 MiB.
_CHUNK = 1 << 19


@dataclass(frozen=True, eq=False)
class Surface:
    """Indexed triangles as a file gives them; absent attributes are None."""

    positions: Float32[np.ndarray, "vertices 3"]
    triangles: Int64[np.ndarray, "triangles 3"]
    normals: Float32[np.ndarray, "vertices 3"] | None = None
    """Any length; zero where there is none."""
    uv: Float32[np.ndarray, "vertices 2"] | None = None
    colors: Float32[np.ndarray, "vertices 3"] | None = None
    """Linear."""
    skinning: Skinning | None = None


def finished_mesh(
    surface: Surface, name: str, material: int, decoded: DecodedBytes, where: str
) -> Mesh | None:
    """The mesh of a surface: triangles of zero area go, normals become unit length or flat.

    Vertices are shared where the file brings normals, and unshared for flat shading, as glTF 2.0
    section 3.7.2.1 asks. A corner whose normal is zero takes its triangle's.

    Returns:
        None where no triangle has area.

    Raises:
        SceneFileError: a coordinate is not finite or absurdly large, or memory runs over the limit.
    """
    for values, what, largest in (
        (surface.positions, "positions", LARGEST_COORDINATE),
        (surface.uv, "uv", 1e9),
    ):
        if values is not None and values.size and not np.abs(values).max() <= largest:
            raise SceneFileError(f"{where}: {what} must be finite and at most {largest:g} in magnitude")
    face_normals, has_area = _face_normals(surface.positions, surface.triangles)
    if not has_area.any():
        return None
    if not has_area.all():
        surface = replace(surface, triangles=surface.triangles[has_area])
        face_normals = face_normals[has_area]
    if surface.normals is None:
        surface, normals = _flat(surface, face_normals)
    else:
        surface, normals = _smooth(_without_unused_vertices(surface), face_normals)
    vertices = len(surface.positions)
    decoded.spend(vertices * (24 + 8 * (surface.uv is not None) + 12 * (surface.colors is not None)), where)
    decoded.spend(12 * len(surface.triangles), where)
    # One row seen as many where the file has none: most scenes have no vertex colours.
    uv = np.broadcast_to(np.zeros(2, np.float32), (vertices, 2)) if surface.uv is None else surface.uv
    colors = (
        np.broadcast_to(np.ones(3, np.float32), (vertices, 3)) if surface.colors is None else surface.colors
    )
    triangles = surface.triangles.astype(np.int32)
    if surface.skinning is not None:
        decoded.spend(sum(array.nbytes for array in vars(surface.skinning).values()), where)
    return Mesh(name, surface.positions, normals, uv, colors, triangles, material, surface.skinning)


def used_vertices(
    corners: Int64[np.ndarray, " corners"], vertex_count: int
) -> tuple[Int64[np.ndarray, " used"], Int64[np.ndarray, " corners"]]:
    """Which of `vertex_count` vertices are referred to, rising, and the corners renumbered to them."""
    # A scene's primitives may all index one large vertex buffer: cost must follow the corners then.
    if len(corners) < vertex_count // 16:
        used, renumbered = np.unique(corners, return_inverse=True)
        return used, renumbered.astype(np.int64)
    is_used = np.zeros(vertex_count, bool)
    is_used[corners] = True
    return np.flatnonzero(is_used), (np.cumsum(is_used) - 1)[corners]


def _face_normals(
    positions: Float32[np.ndarray, "vertices 3"], triangles: Int64[np.ndarray, "triangles 3"]
) -> tuple[Float32[np.ndarray, "triangles 3"], Bool[np.ndarray, " triangles"]]:
    """Unit normals by winding, and which triangles have area (the others' normals are zero)."""
    normals = np.zeros((len(triangles), 3), np.float32)
    has_area = np.zeros(len(triangles), bool)
    for start in range(0, len(triangles), _CHUNK):
        chunk = slice(start, start + _CHUNK)
        first, second, third = (positions[triangles[chunk, i]].astype(np.float64) for i in range(3))
        (ax, ay, az), (bx, by, bz) = (second - first).T, (third - first).T
        # Written out: np.cross costs more than all the rest for a primitive of a few triangles.
        cross = np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)
        length = np.sqrt(np.einsum("ij,ij->i", cross, cross))
        has_area[chunk] = length > 0.0
        np.divide(cross, length[:, None], out=cross, where=length[:, None] > 0.0)
        normals[chunk] = cross
    return normals, has_area


def _flat(
    surface: Surface, face_normals: Float32[np.ndarray, "triangles 3"]
) -> tuple[Surface, Float32[np.ndarray, "corners 3"]]:
    unshared = _gathered(surface, surface.triangles.ravel())
    corners = np.arange(surface.triangles.size, dtype=np.int64).reshape(-1, 3)
    return replace(unshared, triangles=corners), np.repeat(face_normals, 3, axis=0)


def _smooth(
    surface: Surface, face_normals: Float32[np.ndarray, "triangles 3"]
) -> tuple[Surface, Float32[np.ndarray, "vertices 3"]]:
    normals, has_normal = unit_rows(surface.normals.astype(np.float64))
    lacking = ~has_normal[surface.triangles]
    if not lacking.any():
        return surface, normals
    # A vertex of its own for each corner that must take its triangle's normal.
    triangle, corner = np.nonzero(lacking)
    sources = np.concatenate([np.arange(len(normals)), surface.triangles[triangle, corner]])
    triangles = surface.triangles.copy()
    triangles[triangle, corner] = len(normals) + np.arange(len(triangle))
    normals = np.concatenate([normals, face_normals[triangle]])
    extended = replace(_gathered(surface, sources), triangles=triangles)
    used, corners = used_vertices(triangles.ravel(), len(sources))
    return replace(_gathered(extended, used), triangles=corners.reshape(-1, 3)), normals[used]


def unit_rows(
    rows: Float64[np.ndarray, "n 3"],
) -> tuple[Float32[np.ndarray, "n 3"], Bool[np.ndarray, " n"]]:
    """The rows at unit length, and which of them are longer than zero (the others stay zero)."""
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    unit = np.divide(rows, length, out=np.zeros_like(rows), where=length > 0.0)
    return unit.astype(np.float32), length[:, 0] > 0.0


def _without_unused_vertices(surface: Surface) -> Surface:
    used, corners = used_vertices(surface.triangles.ravel(), len(surface.positions))
    if len(used) == len(surface.positions):
        return surface
    return replace(_gathered(surface, used), triangles=corners.reshape(-1, 3))


def _gathered(surface: Surface, rows: Int64[np.ndarray, " rows"]) -> Surface:
    """The surface with vertex i taken from old vertex rows[i]; triangles are left as they were."""
    return Surface(
        surface.positions[rows],
        surface.triangles,
        normals=None if surface.normals is None else surface.normals[rows],
        uv=None if surface.uv is None else surface.uv[rows],
        colors=None if surface.colors is None else surface.colors[rows],
        skinning=None if surface.skinning is None else surface.skinning.rows(rows),
    )
