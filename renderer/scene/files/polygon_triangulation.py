"""Triangulation of the polygons in OBJ and PLY files, including concave ones."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float64, Int64

from vpltune.renderer.scene.files.diagnostics import SceneFileError

# A choice: most corners of a face. Ear clipping takes quadratic time, and hand-made faces have far fewer.
_MOST_CORNERS = 2000
# A choice: corners that are worked on at a time, in memory of about 300 bytes each.
_BATCH = 1 << 17


def triangulated(
    sizes: Int64[np.ndarray, " faces"],
    positions: Float64[np.ndarray, "corner_count 3"],
    where: str,
) -> Int64[np.ndarray, "triangles 3"]:
    """Triangles as corner indices. They keep the order and the winding of the faces.

    Args:
        sizes: corner count of each face, at least 3. The corners of all faces are numbered consecutively.
        positions: position of each corner.
        where: the place in the file, for messages.

    Raises:
        SceneFileError: a face has too many corners to be triangulated in reasonable time.
    """
    if sizes.max(initial=0) > _MOST_CORNERS:
        raise SceneFileError(f"{where}: a face must have at most {_MOST_CORNERS} corners, got {sizes.max()}")
    starts = np.cumsum(sizes) - sizes
    first_triangles = np.cumsum(sizes - 2) - (sizes - 2)
    triangles = np.empty((int((sizes - 2).sum()), 3), np.int64)
    concave: list[Int64[np.ndarray, " faces"]] = []
    normals = np.zeros((len(sizes), 3))
    for faces in _alike(sizes):
        size = int(sizes[faces[0]])
        fans = _fans(starts[faces], size)
        triangles[first_triangles[faces, None] + np.arange(size - 2)] = fans
        if size > 3:
            normals[faces], is_concave = _seen_along_normal(fans, positions)
            concave.append(faces[is_concave])
    for faces in _batches(np.concatenate([*concave, np.empty(0, np.int64)]), sizes):
        own = sizes[faces]
        within = np.arange(own.max())
        corners = starts[faces, None] + np.minimum(within, own[:, None] - 1)
        clipped = _clipped_ears(_flat(positions[corners], normals[faces]), own)
        for face, cut in zip(faces, clipped, strict=True):
            triangles[first_triangles[face] : first_triangles[face] + len(cut)] = starts[face] + cut
    return triangles


def _alike(sizes: Int64[np.ndarray, " faces"]) -> Iterator[Int64[np.ndarray, " some"]]:
    """Faces of the same size together, at most `_BATCH` corners."""
    order = np.argsort(sizes, kind="stable")
    ends = [0, *(np.flatnonzero(np.diff(sizes[order])) + 1).tolist(), len(order)]
    for first, end in pairwise(ends):
        step = max(_BATCH // int(sizes[order[first]]), 1) if end > first else 1
        for start in range(first, end, step):
            yield order[start : min(start + step, end)]


def _fans(starts: Int64[np.ndarray, " faces"], size: int) -> Int64[np.ndarray, "faces size_less_2 3"]:
    second = np.arange(1, size - 1)
    return starts[:, None, None] + np.stack([np.zeros_like(second), second, second + 1], axis=1)


def _seen_along_normal(
    fans: Int64[np.ndarray, "faces count 3"], positions: Float64[np.ndarray, "corner_count 3"]
) -> tuple[Float64[np.ndarray, "faces 3"], Bool[np.ndarray, " faces"]]:
    """Newell's normal of each polygon, and where some triangle of its fan faces the other way."""
    a, b, c = (positions[fans[:, :, i]] for i in range(3))
    areas = np.cross(b - a, c - a)
    whole = areas.sum(axis=1)
    return whole, ((areas * whole[:, None]).sum(axis=2) < 0.0).any(axis=1)


def _batches(
    faces: Int64[np.ndarray, " faces"], sizes: Int64[np.ndarray, " all"]
) -> list[Int64[np.ndarray, " some"]]:
    """Faces, ascending by size, in batches that take about the same memory."""
    batches, first = [], 0
    for end in range(1, len(faces) + 1):
        if end == len(faces) or (end + 1 - first) * sizes[faces[end]] > _BATCH:
            batches.append(faces[first:end])
            first = end
    return batches


def _flat(
    points: Float64[np.ndarray, "faces size 3"], normals: Float64[np.ndarray, "faces 3"]
) -> Float64[np.ndarray, "2 faces size"]:
    """Each polygon projected along the dominant axis of its normal, so that it winds counter-clockwise."""
    drop = np.abs(normals).argmax(axis=1)
    face = np.arange(len(points))
    first, second = np.where(drop == 0, 1, 0), np.where(drop == 2, 1, 2)
    # Dropping y mirrors the projection.
    mirrored = (normals[face, drop] < 0.0) != (drop == 1)
    first, second = np.where(mirrored, second, first), np.where(mirrored, first, second)
    return np.stack([points[face, :, first], points[face, :, second]])


def _clipped_ears(
    flat: Float64[np.ndarray, "2 faces size"], sizes: Int64[np.ndarray, " faces"]
) -> list[Int64[np.ndarray, "size_less_2 3"]]:
    """Ear clipping (Meisters 1975), one ear of every polygon at a time.

    Clipping an ear of a simple polygon changes which corners are ears at its two neighbours alone.

    Args:
        flat: x and y of the polygons' corners. Those beyond a polygon's size do not count.
        sizes: corner count of each polygon, ascending.

    Returns:
        The triangles of each polygon as places of its corners.
    """
    _, count, longest = flat.shape
    place = np.arange(longest)
    left = place < sizes[:, None]
    before = np.broadcast_to(place - 1, left.shape).copy()
    after = np.broadcast_to(place + 1, left.shape).copy()
    before[:, 0], after[np.arange(count), sizes - 1] = sizes - 1, 0
    ears = np.zeros_like(left)
    for tip in range(longest):
        faces = np.flatnonzero(tip < sizes)
        near = np.full(len(faces), tip)
        ears[faces, tip] = _is_ear(flat, left, faces, before[faces, tip], near, after[faces, tip])
    triangles = np.empty((count, longest - 2, 3), np.int64)
    for step in range(longest - 2):
        faces = np.flatnonzero(step < sizes - 2)
        # Without an ear, the outline intersects itself: any corner serves.
        has_ear = ears[faces].any(axis=1)
        tip = np.where(has_ear, ears[faces].argmax(axis=1), left[faces].argmax(axis=1))
        low, high = before[faces, tip], after[faces, tip]
        triangles[faces, step] = np.stack([low, tip, high], axis=1)
        left[faces, tip] = ears[faces, tip] = False
        after[faces, low], before[faces, high] = high, low
        for near in (low, high):
            ears[faces, near] = _is_ear(flat, left, faces, before[faces, near], near, after[faces, near])
    return [triangles[face, : size - 2] for face, size in enumerate(sizes)]


def _is_ear(
    flat: Float64[np.ndarray, "2 faces size"],
    left: Bool[np.ndarray, "faces size"],
    faces: Int64[np.ndarray, " some"],
    before: Int64[np.ndarray, " some"],
    tip: Int64[np.ndarray, " some"],
    after: Int64[np.ndarray, " some"],
) -> Bool[np.ndarray, " some"]:
    """Whether a corner of each of `faces` turns left, and its triangle holds no other corner that is left."""
    triangle = [flat[:, faces, corner] for corner in (before, tip, after)]
    is_ear = _turn(*triangle) > 0.0
    tried = np.flatnonzero(is_ear)
    points = flat[:, faces[tried]]
    corners = [corner[:, tried, None] for corner in triangle]
    inside = left[faces[tried]]
    for start, end in ((0, 1), (1, 2), (2, 0)):
        inside &= _turn(corners[start], corners[end], points) >= 0.0
    # A corner at the same position as one of the ear's own, as at the seam of a hole, does not block it.
    for corner in corners:
        inside &= (points != corner).any(axis=0)
    is_ear[tried] = ~inside.any(axis=1)
    return is_ear


def _turn(start: np.ndarray, end: np.ndarray, point: np.ndarray) -> Float64[np.ndarray, "*points"]:
    """Twice the signed area of a triangle; positive if it turns left. The first axis is x and y."""
    return (end[0] - start[0]) * (point[1] - start[1]) - (end[1] - start[1]) * (point[0] - start[0])
