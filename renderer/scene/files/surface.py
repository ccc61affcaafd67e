"""Conversion of triangles from a file to a valid mesh: no zero areas, finite positions and unit normals."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int64

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.limits import LARGEST_COORDINATE, LARGEST_NORMAL, LARGEST_UV, DecodedBytes
from vpltune.renderer.scene.scene import Mesh
from vpltune.renderer.scene.scene_animation import Skinning

# A choice: triangles processed at a time. It keeps float64 temporaries of a large mesh below about 100 MiB.
_CHUNK = 1 << 19


@dataclass(frozen=True, eq=False)
class Surface:
    """Indexed triangles as in the file. Absent attributes are None."""

    positions: Float32[np.ndarray, "vertices 3"]
    triangles: Int64[np.ndarray, "triangles 3"]
    normals: Float32[np.ndarray, "vertices 3"] | None = None
    """Any length; zero means that the vertex has no normal."""
    uv: Float32[np.ndarray, "vertices 2"] | None = None
    colors: Float32[np.ndarray, "vertices 3"] | None = None
    """Linear, in [0, 1]."""
    skinning: Skinning | None = None


def finished_mesh(
    surface: Surface, name: str, material: int, decoded: DecodedBytes, where: str
) -> Mesh | None:
    """The mesh of a surface, without triangles of zero area and with unit normals.

    With normals in the file, vertices stay shared. Without them, shading is flat and no vertices are shared,
    as glTF 2.0 section 3.7.2.1 requires. A corner with a zero normal gets the normal of its triangle.

    Args:
        surface: the triangles.
        name: of the mesh.
        material: index into the scene's materials.
        decoded: the memory limit.
        where: the place in the file, for messages.

    Returns:
        None if no triangle has area.

    Raises:
        SceneFileError: a coordinate is not finite or too large, or the memory limit is exceeded.
    """
    require_within(surface.positions, "positions", LARGEST_COORDINATE, where)
    require_within(surface.normals, "normals", LARGEST_NORMAL, where)
    require_within(surface.uv, "uv", LARGEST_UV, where)
    flat_normals, has_area = face_normals(surface.positions, surface.triangles)
    if not has_area.any():
        return None
    if not has_area.all():
        surface = replace(surface, triangles=surface.triangles[has_area])
        flat_normals = flat_normals[has_area]
    per_vertex = bytes_per_vertex(surface.uv is not None, surface.colors is not None)
    decoded.spend(12 * len(surface.triangles), where)
    if surface.normals is None:
        decoded.spend(per_vertex * surface.triangles.size, where)
        surface, normals = _flat(surface, flat_normals)
    else:
        surface = _without_unused_vertices(surface)
        assert surface.normals is not None
        unit, has_normal = unit_rows(surface.normals.astype(np.float64))
        lacking = ~has_normal[surface.triangles]
        decoded.spend(per_vertex * (len(unit) + int(lacking.sum())), where)
        surface, normals = _smooth(surface, unit, lacking, flat_normals)
    vertices = len(surface.positions)
    # Absent attributes are one broadcast row: most scenes have no vertex colours.
    uv = np.broadcast_to(np.zeros(2, np.float32), (vertices, 2)) if surface.uv is None else surface.uv
    colors = (
        np.broadcast_to(np.ones(3, np.float32), (vertices, 3)) if surface.colors is None else surface.colors
    )
    triangles = surface.triangles.astype(np.int32)
    if surface.skinning is not None:
        decoded.spend(sum(array.nbytes for array in vars(surface.skinning).values()), where)
    return Mesh(name, surface.positions, normals, uv, colors, triangles, material, surface.skinning)


def turned(mesh: Mesh) -> Mesh:
    """The mesh wound the other way: what was its back is its front. The normals point there too."""
    return replace(mesh, triangles=np.ascontiguousarray(mesh.triangles[:, ::-1]), normals=-mesh.normals)


def bytes_per_vertex(has_uv: bool, has_colors: bool) -> int:
    """What a vertex of a mesh takes: position, normal, and what else it has of its own."""
    return 24 + 8 * has_uv + 12 * has_colors


def require_within(values: np.ndarray | None, what: str, largest: float, where: str) -> None:
    """Check that no number, if there are any, is larger than `largest` in magnitude.

    Raises:
        SceneFileError: one is, or is not finite. The message names `where` and `what`.
    """
    if values is not None and values.size and not np.abs(values).max() <= largest:
        wrong = values[~(np.abs(values) <= largest)][0]
        raise SceneFileError(
            f"{where}: {what} must be finite and at most {largest:g} in magnitude, got {wrong:g}"
        )


def used_vertices(
    corners: Int64[np.ndarray, " corners"], vertex_count: int
) -> tuple[Int64[np.ndarray, " used"], Int64[np.ndarray, " corners"]]:
    """The indices of used vertices in ascending order, and the corners as indices into them."""
    # Many primitives may share one large vertex buffer, so for few corners the cost must not depend on it.
    if len(corners) < vertex_count // 16:
        used, renumbered = np.unique(corners, return_inverse=True)
        return used, renumbered.astype(np.int64)
    is_used = np.zeros(vertex_count, bool)
    is_used[corners] = True
    return np.flatnonzero(is_used), (np.cumsum(is_used) - 1)[corners]


def face_normals(
    positions: Float32[np.ndarray, "vertices 3"], triangles: Int64[np.ndarray, "triangles 3"]
) -> tuple[Float32[np.ndarray, "triangles 3"], Bool[np.ndarray, " triangles"]]:
    """Unit normals from the winding, and which triangles have area. Normals of the others are zero."""
    normals = np.zeros((len(triangles), 3), np.float32)
    has_area = np.zeros(len(triangles), bool)
    for start in range(0, len(triangles), _CHUNK):
        chunk = slice(start, start + _CHUNK)
        first, second, third = (positions[triangles[chunk, i]].astype(np.float64) for i in range(3))
        (ax, ay, az), (bx, by, bz) = (second - first).T, (third - first).T
        # Written out because np.cross dominates the cost for primitives of a few triangles.
        cross = np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)
        length = np.sqrt(np.einsum("ij,ij->i", cross, cross))
        has_area[chunk] = length > 0.0
        np.divide(cross, length[:, None], out=cross, where=length[:, None] > 0.0)
        normals[chunk] = cross
    return normals, has_area


def _flat(
    surface: Surface, flat_normals: Float32[np.ndarray, "triangles 3"]
) -> tuple[Surface, Float32[np.ndarray, "corners 3"]]:
    unshared = gathered(surface, surface.triangles.ravel())
    corners = np.arange(surface.triangles.size, dtype=np.int64).reshape(-1, 3)
    return replace(unshared, triangles=corners), np.repeat(flat_normals, 3, axis=0)


def _smooth(
    surface: Surface,
    normals: Float32[np.ndarray, "vertices 3"],
    lacking: Bool[np.ndarray, "triangles 3"],
    flat_normals: Float32[np.ndarray, "triangles 3"],
) -> tuple[Surface, Float32[np.ndarray, "vertices_and_corners 3"]]:
    if not lacking.any():
        return surface, normals
    # Each corner that gets its triangle's normal needs its own vertex.
    triangle, corner = np.nonzero(lacking)
    sources = np.concatenate([np.arange(len(normals)), surface.triangles[triangle, corner]])
    triangles = surface.triangles.copy()
    triangles[triangle, corner] = len(normals) + np.arange(len(triangle))
    normals = np.concatenate([normals, flat_normals[triangle]])
    extended = replace(gathered(surface, sources), triangles=triangles)
    used, corners = used_vertices(triangles.ravel(), len(sources))
    return replace(gathered(extended, used), triangles=corners.reshape(-1, 3)), normals[used]


def unit_rows(
    rows: Float64[np.ndarray, "n 3"],
) -> tuple[Float32[np.ndarray, "n 3"], Bool[np.ndarray, " n"]]:
    """The rows scaled to unit length, and which of them are not zero. Zero rows stay zero."""
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    unit = np.divide(rows, length, out=np.zeros_like(rows), where=length > 0.0)
    return unit.astype(np.float32), length[:, 0] > 0.0


def _without_unused_vertices(surface: Surface) -> Surface:
    used, corners = used_vertices(surface.triangles.ravel(), len(surface.positions))
    if len(used) == len(surface.positions):
        return surface
    return replace(gathered(surface, used), triangles=corners.reshape(-1, 3))


def gathered(surface: Surface, rows: Int64[np.ndarray, " rows"]) -> Surface:
    """The surface whose vertex i is the old vertex rows[i]. The triangles are unchanged."""
    return Surface(
        surface.positions[rows],
        surface.triangles,
        normals=None if surface.normals is None else surface.normals[rows],
        uv=None if surface.uv is None else surface.uv[rows],
        colors=None if surface.colors is None else surface.colors[rows],
        skinning=None if surface.skinning is None else surface.skinning.rows(rows),
    )
