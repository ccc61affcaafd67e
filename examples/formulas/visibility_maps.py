"""What each VPL sees, in a small hemispherical map: docs/runtime_formulas.md, "Visibility maps".

Positions and distances in a map count from its origin, in units of L, in the VPL's frame.
"""

import numpy as np

from examples.formulas.vectors import dot, length, unit

LIFT = 0.01
NOTHING = 2.0
FARTHEST = 1.5
LEAST_OVERLAP = 2e-3
ROUNDING = 1e-4
SHEET_COSINE, SHEET_BEND, SHEET_TILT = -0.7, 0.3, 0.5
CORNER_COSINE = 0.99
VERTICES = ((-1, -1), (1, -1), (-1, 1), (1, 1))


def hemisphere_frame(normal: np.ndarray) -> np.ndarray:
    """Rows tangent, bitangent, normal (Duff et al. 2017)."""
    x, y, z = normal
    s = 1.0 if z >= -0.5 else -1.0
    a = -1.0 / (s + z)
    b = x * y * a
    return np.array([[1.0 + s * x * x * a, s * b, -s * x], [b, s + y * y * a, -y], normal])


def map_origin(position, normal, footprint: float) -> np.ndarray:
    """Where rays start, in the world: a little off the VPL's surface."""
    return position + normal * LIFT * footprint


def hemi_octahedral_encode(direction: np.ndarray) -> np.ndarray:
    """Directions with z > 0, of any length, on [−1, 1]² (Cigolle et al. 2014)."""
    p = direction[..., :2] / (np.abs(direction[..., :2]).sum(-1, keepdims=True) + direction[..., 2:])
    return np.stack([p[..., 0] + p[..., 1], p[..., 0] - p[..., 1]], axis=-1)


def hemi_octahedral_decode(encoded: np.ndarray) -> np.ndarray:
    x = (encoded[..., 0] + encoded[..., 1]) / 2.0
    y = (encoded[..., 0] - encoded[..., 1]) / 2.0
    return unit(np.stack([x, y, 1.0 - np.abs(x) - np.abs(y)], axis=-1))


def texel_axis(column, row, size: int) -> np.ndarray:
    """Unit direction of a texel's centre, in the VPL's frame."""
    return hemi_octahedral_decode((np.stack([column, row], axis=-1) + 0.5) * (2.0 / size) - 1.0)


def place_on_map(direction: np.ndarray, size: int) -> np.ndarray:
    """Column and row of a direction, in texels of a map with `size` of them along its side."""
    return np.minimum((hemi_octahedral_encode(direction) * 0.5 + 0.5) * size, size - 0.5)


def overlap(end, end_normal, receiver, receiver_normal) -> np.ndarray:
    """By how much of its distance a receiver is overlapped by the surface that a ray met at `end`."""
    between = end - receiver
    return np.minimum(dot(between, receiver_normal), dot(between, end_normal)) / length(receiver)


def shows_its_back(end, end_normal, receiver, receiver_normal) -> bool:
    """Whether a receiver is on the other side of the sheet that was met."""
    between = end - receiver
    apart, rounding = length(between), ROUNDING * (length(end) + length(receiver))
    return bool(
        dot(end_normal, receiver_normal) < SHEET_COSINE
        and dot(between, end_normal) > -SHEET_BEND * apart - rounding
        and dot(between, receiver_normal) > -SHEET_TILT * apart - rounding
    )


def rim_overlap(end, end_normal, receiver, receiver_normal) -> float:
    """`overlap` for a receiver whose tangent plane hides the middle of a disc."""
    flat = receiver_normal * [1.0, 1.0, 0.0]
    cut = flat * (dot(receiver, receiver_normal) / max(dot(flat, flat), 1e-12))
    return float(min(dot(end - receiver, end_normal), dot(end - cut, end_normal)) / length(receiver))


def corner_overlap(end, end_normal, receiver, receiver_normal) -> float:
    """`overlap` with a plane that a corner extends to the receiver's direction."""
    if shows_its_back(end, end_normal, receiver, receiver_normal):
        return 1.0
    if not dot(receiver, receiver_normal) < 0.0:
        return rim_overlap(end, end_normal, receiver, receiver_normal)
    if not dot(end - receiver, receiver_normal) > -ROUNDING * length(receiver):
        return -1.0
    return float(dot(end - receiver, end_normal) / length(receiver))


def is_behind(end, other, other_normal) -> bool:
    """Whether a hit lies behind the plane of another one, by more than rounding."""
    return bool(dot(end - other, other_normal) < -ROUNDING * (length(end) + length(other)))


def corner_marks(end: np.ndarray, normal: np.ndarray, farthest: float) -> np.ndarray:
    """[row, column]: 0 for no corner, 1 for one, 2 … 5 where a vertex of three planes is near.

    Arguments as for `is_silhouette`.
    """
    size = len(end)
    marks = np.zeros((size, size), int)

    def is_corner(a: tuple[int, int], b: tuple[int, int]) -> bool:
        behind = is_behind(end[a], end[b], normal[b]) or is_behind(end[b], end[a], normal[a])
        return bool(dot(normal[a], normal[b]) < CORNER_COSINE) and not behind

    for own in np.ndindex(size, size):
        for vertex, (x, y) in enumerate(VERTICES):
            row, column = own
            found = []
            for beside in ((row, column + x), (row + y, column), (row + y, column + x)):
                if min(beside) < 0 or max(beside) >= size or length(end[own]) >= farthest:
                    continue
                if length(end[beside]) < farthest and is_corner(own, beside):
                    if found and is_corner(found[-1], beside):
                        marks[own] = 2 + vertex
                    found.append(beside)
                    marks[own] = max(marks[own], 1)
    return marks


def seen_share(overlapping, bias: float, softness: float) -> np.ndarray:
    """Share of the light that passes."""
    return 1.0 - np.clip((overlapping - bias) / softness, 0.0, 1.0)


def is_silhouette(end: np.ndarray, normal: np.ndarray, farthest: float) -> np.ndarray:
    """[row, column]: whether a texel and a neighbour hide one another, or one of the two met nothing.

    Args:
        end, normal: [row, column, 3] what each texel's ray met.
        farthest: 1.5 · diagonal / L; what lies farther is nothing, and is hidden by nothing.
    """
    size = len(end)
    result = np.zeros((size, size), bool)
    for row, column in np.ndindex(size, size):
        beside = np.s_[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
        own, own_normal = end[row, column], normal[row, column]
        others, other_normals = end[beside].reshape(-1, 3), normal[beside].reshape(-1, 3)
        hides_other = (overlap(own, own_normal, others, other_normals) > LEAST_OVERLAP) & (
            length(others) < farthest
        )
        is_hidden = (overlap(others, other_normals, own, own_normal) > LEAST_OVERLAP) & (
            length(own) < farthest
        )
        one_misses = (length(own) < farthest) != (length(others) < farthest)
        result[row, column] = (hides_other | is_hidden | one_misses).any()
    return result


def vpl_visibility(position, normal, vpl: dict, maps: dict, scene_length: float, bias, softness) -> float:
    """Share of a VPL's light that reaches a receiver.

    Args:
        position, normal: of the receiver, in the world.
        vpl: `position`, `normal`, `footprint`.
        maps: `end`, `normal` [size, size, 3]; `corner` [size, size], from `corner_marks`; `block` [size,
            size], −1 or the number of a finer block; `block_end`, `block_normal` [blocks, refinement,
            refinement, 3].
    """
    frame = hemisphere_frame(vpl["normal"])
    origin = map_origin(vpl["position"], vpl["normal"], vpl["footprint"])
    receiver = frame @ (position - origin) / scene_length
    receiver_normal = frame @ normal
    if not receiver[2] > 0.0:
        return 1.0
    refinement = maps["block_end"].shape[1]
    finest = len(maps["end"]) * refinement
    place = place_on_map(receiver, finest)
    column, row = place.astype(int)
    coarse = (row // refinement, column // refinement)
    own = met_at(maps, column, row)
    facing = dot(receiver, receiver_normal) < 0.0
    hidden = (overlap if facing else rim_overlap)(*own, receiver, receiver_normal)
    hidden = 1.0 if shows_its_back(*own, receiver, receiver_normal) else hidden
    is_block = maps["block"][coarse] >= 0
    mark = 1 if is_block else maps["corner"][coarse]
    if mark > 0:
        around = texels_around(place, 1 if is_block else refinement, mark)
        met = [own] + [
            met_at(maps, x, y) if min(x, y) >= 0 and max(x, y) < finest else own for x, y in around
        ]
        for each in met:
            if not is_behind(each[0], *own) and not any(is_behind(other[0], *each) for other in met):
                hidden = max(hidden, corner_overlap(*each, receiver, receiver_normal))
    return float(seen_share(hidden, bias, softness))


def met_at(maps: dict, column: int, row: int) -> tuple[np.ndarray, np.ndarray]:
    """End and normal of the texel at a place, which counts finest texels."""
    refinement = maps["block_end"].shape[1]
    coarse = (row // refinement, column // refinement)
    block = maps["block"][coarse]
    if block < 0:
        return maps["end"][coarse], maps["normal"][coarse]
    fine = (block, row % refinement, column % refinement)
    return maps["block_end"][fine], maps["block_normal"][fine]


def texels_around(place: np.ndarray, side: int, mark: int) -> list[tuple[int, int]]:
    """Column and row of a place in each of the three texels around the one at `place`, `side` wide."""
    start = place.astype(int) // side * side
    beyond = np.array(VERTICES[mark - 2]) > 0 if mark >= 2 else 2.0 * place >= 2 * start + side
    column, row = (int(c) for c in np.where(beyond, start + side, start - 1))
    own_column, own_row = place.astype(int)
    return [(column, own_row), (own_column, row), (column, row)]
