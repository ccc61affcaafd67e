"""Triangulation of the polygons in OBJ and PLY files, including concave ones."""

import numpy as np
from jaxtyping import Float64, Int64

from vpltune.renderer.scene.files.diagnostics import SceneFileError

# A choice: most corners of a face. Ear clipping takes quadratic time, and hand-made faces have far fewer.
_MOST_CORNERS = 2000


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
    parts, faces = [np.empty((0, 3), np.int64)], [np.empty(0, np.int64)]
    for size in np.unique(sizes):
        of_size = np.flatnonzero(sizes == size)
        polygons = starts[of_size, None] + np.arange(size)
        cut = _triangulated_alike(polygons, positions)
        parts.append(cut.reshape(-1, 3))
        faces.append(np.repeat(of_size, size - 2))
    return np.concatenate(parts)[np.argsort(np.concatenate(faces), kind="stable")]


def _triangulated_alike(
    polygons: Int64[np.ndarray, "faces size"], positions: Float64[np.ndarray, "corner_count 3"]
) -> Int64[np.ndarray, "faces size_less_2 3"]:
    size = polygons.shape[1]
    fans = np.stack(
        [np.broadcast_to(polygons[:, :1], (len(polygons), size - 2)), polygons[:, 1:-1], polygons[:, 2:]],
        axis=2,
    )
    if size == 3:
        return fans
    a, b, c = (positions[fans[:, :, i]] for i in range(3))
    areas = np.cross(b - a, c - a)
    # Newell's normal of the whole polygon. If all triangles of the fan face its way, the fan is valid.
    whole = areas.sum(axis=1, keepdims=True)
    for face in np.flatnonzero(((areas * whole).sum(axis=2) < 0.0).any(axis=1)):
        fans[face] = polygons[face][_clipped_ears(positions[polygons[face]], whole[face, 0])]
    return fans


def _clipped_ears(
    points: Float64[np.ndarray, "size 3"], normal: Float64[np.ndarray, "3"]
) -> Int64[np.ndarray, "size_less_2 3"]:
    """Ear clipping (Meisters 1975) of the polygon projected along the dominant axis of its normal."""
    drop = int(np.abs(normal).argmax())
    flat = np.delete(points, drop, axis=1)
    # Dropping y mirrors the projection.
    if (normal[drop] < 0.0) != (drop == 1):
        flat = flat[:, ::-1]
    left = list(range(len(points)))
    triangles = []
    while len(left) > 3:
        ear = next(
            (i for i in range(len(left)) if _is_ear(flat, left, i)), 0
        )  # 0: a self-intersecting outline may have no ear
        triangles.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    triangles.append(tuple(left))
    return np.array(triangles, np.int64)


def _is_ear(flat: Float64[np.ndarray, "size 2"], left: list[int], at: int) -> bool:
    before, tip, after = (flat[left[(at + step) % len(left)]] for step in (-1, 0, 1))
    if _turn(before, tip, after) <= 0.0:
        return False
    others = flat[[index for step, index in enumerate(left) if (step - at + 1) % len(left) > 2]]
    edges = ((before, tip), (tip, after), (after, before))
    inside = np.ones(len(others), bool)
    for start, end in edges:
        inside &= _turn(start, end, others.T) >= 0.0
    # A corner at the same position as one of the ear's own, as at the seam of a hole, does not block it.
    for corner in (before, tip, after):
        inside &= (others != corner).any(axis=1)
    return not inside.any()


def _turn(
    start: Float64[np.ndarray, "2"], end: Float64[np.ndarray, "2"], point: Float64[np.ndarray, " 2 *points"]
) -> np.float64 | Float64[np.ndarray, "*points"]:
    """Twice the signed area of a triangle; positive if it turns left."""
    return (end[0] - start[0]) * (point[1] - start[1]) - (end[1] - start[1]) * (point[0] - start[0])
