"""Meshes from the parts of one surface, all at once: a file may have 10,000 materials of one triangle each.

The meshes are those that `finished_mesh` makes of each part alone. That takes 150 µs for a triangle, most of
it for the calls of numpy.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float32, Int64

from vpltune.renderer.scene.files.limits import LARGEST_COORDINATE, LARGEST_NORMAL, LARGEST_UV, DecodedBytes
from vpltune.renderer.scene.files.surface import (
    Surface,
    bytes_per_vertex,
    face_normals,
    finished_mesh,
    gathered,
    require_within,
    unit_rows,
)
from vpltune.renderer.scene.scene import Mesh

# A choice: corners of parts that are worked on together, in memory of about 200 bytes each.
_BATCH = 1 << 17


@dataclass(frozen=True)
class Part:
    """What one mesh is made of. Parts follow one another in the surface, and share no vertices."""

    name: str
    """The name of the mesh."""
    material: int
    """Index into the scene's materials."""
    where: str
    """The place in the file, for messages."""
    vertex_count: int
    triangle_count: int
    has_uv: bool
    """Whether any of its vertices has a uv in the file."""


def batches(triangle_counts: list[int]) -> Iterator[slice]:
    """Parts that follow one another, in batches that `finished_meshes` has the memory for; one at least.

    Args:
        triangle_counts: of each part.
    """
    first, corners = 0, 0
    for part, count in enumerate(triangle_counts):
        if part > first and corners + 3 * count > _BATCH:
            yield slice(first, part)
            first, corners = part, 0
        corners += 3 * count
    if first < len(triangle_counts):
        yield slice(first, len(triangle_counts))


def finished_meshes(surface: Surface, parts: list[Part], decoded: DecodedBytes) -> list[Mesh]:
    """The meshes of the parts, without triangles of zero area and with unit normals.

    Args:
        surface: the vertices and triangles of all parts, in their order, without skinning. Every vertex is
            a triangle's.
        parts: at least one; their counts add up to the surface's.
        decoded: the memory limit.

    Returns:
        A mesh for each part that has a triangle with area.

    Raises:
        SceneFileError: a coordinate is not finite or too large, or the memory limit is exceeded.
    """
    if len(parts) == 1:
        mesh = finished_mesh(surface, parts[0].name, parts[0].material, decoded, parts[0].where)
        return [] if mesh is None else [mesh]
    vertex_ends = np.cumsum([part.vertex_count for part in parts])
    _require_within(surface, parts, vertex_ends)
    part_of_triangle = np.repeat(np.arange(len(parts)), [part.triangle_count for part in parts])
    flat, has_area = face_normals(surface.positions, surface.triangles)
    triangles, flat, part_of_triangle = (
        surface.triangles[has_area],
        flat[has_area],
        part_of_triangle[has_area],
    )
    unit, has_normal = _unit_normals(surface)
    # The vertices as they are, and one more for each corner that gets its triangle's normal. A part without
    # normals uses the latter alone, in the order of its corners: it is flat.
    triangle, corner = np.nonzero(~has_normal[triangles])
    sources = np.concatenate([np.arange(len(unit)), triangles[triangle, corner]])
    triangles[triangle, corner] = len(unit) + np.arange(len(triangle))
    is_used = np.zeros(len(sources), bool)
    is_used[triangles] = True
    part_of_source = np.searchsorted(vertex_ends, sources, side="right")
    order = np.argsort(part_of_source, kind="stable")
    order = order[is_used[order]]
    vertex_counts = np.bincount(part_of_source[order], minlength=len(parts))
    place_in_part = np.empty(len(sources), np.int64)
    starts = np.cumsum(vertex_counts) - vertex_counts
    place_in_part[order] = np.arange(len(order)) - np.repeat(starts, vertex_counts)
    finished = replace(
        gathered(surface, sources[order]),
        triangles=place_in_part[triangles],
        normals=np.concatenate([unit, flat[triangle]])[order],
    )
    triangle_counts = np.bincount(part_of_triangle, minlength=len(parts))
    return list(_cut(finished, parts, vertex_counts.tolist(), triangle_counts.tolist(), decoded))


def _require_within(surface: Surface, parts: list[Part], vertex_ends: Int64[np.ndarray, " parts"]) -> None:
    limits = {"positions": LARGEST_COORDINATE, "normals": LARGEST_NORMAL, "uv": LARGEST_UV}
    rows = {what: getattr(surface, what) for what in limits if getattr(surface, what) is not None}
    if all(np.abs(values).max(initial=0.0) <= limits[what] for what, values in rows.items()):
        return
    for part, end in zip(parts, vertex_ends.tolist(), strict=True):
        for what, values in rows.items():
            require_within(values[end - part.vertex_count : end], what, limits[what], part.where)


def _unit_normals(
    surface: Surface,
) -> tuple[Float32[np.ndarray, "vertices 3"], Bool[np.ndarray, " vertices"]]:
    """Unit normals, and which vertices have one. Those of the others are zero."""
    if surface.normals is None:
        return np.zeros((len(surface.positions), 3), np.float32), np.zeros(len(surface.positions), bool)
    return unit_rows(surface.normals.astype(np.float64))


def _cut(
    finished: Surface,
    parts: list[Part],
    vertex_counts: list[int],
    triangle_counts: list[int],
    decoded: DecodedBytes,
) -> Iterator[Mesh]:
    """A mesh for each part that has triangles. Absent attributes are one broadcast row."""
    rows = (len(finished.positions), 3)
    no_uv = np.broadcast_to(np.zeros(2, np.float32), (rows[0], 2))
    colors = np.broadcast_to(np.ones(3, np.float32), rows) if finished.colors is None else finished.colors
    normals, triangles = finished.normals, finished.triangles.astype(np.int32)
    assert normals is not None
    vertex = triangle = 0
    for part, vertices, count in zip(parts, vertex_counts, triangle_counts, strict=True):
        if count == 0:
            continue
        has_uv = part.has_uv and finished.uv is not None
        each = bytes_per_vertex(has_uv, finished.colors is not None)
        decoded.spend(12 * count + each * vertices, part.where)
        own, vertex = slice(vertex, vertex + vertices), vertex + vertices
        cut, triangle = slice(triangle, triangle + count), triangle + count
        uv = finished.uv if has_uv and finished.uv is not None else no_uv
        yield Mesh(
            part.name,
            finished.positions[own],
            normals[own],
            uv[own],
            colors[own],
            triangles[cut],
            part.material,
        )
