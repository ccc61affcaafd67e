"""What each VPL sees, in a small hemispherical map: docs/runtime_formulas.md, "Visibility maps".

Positions and distances in a map count from its origin, in units of L, in the VPL's frame.
"""

import numpy as np

from examples.formulas.vectors import dot, length, unit

LIFT = 0.01
NOTHING = 2.0
FARTHEST = 1.5
LEAST_OVERLAP = 2e-3


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


def looked_up(direction: np.ndarray, size: int) -> tuple[int, int, np.ndarray]:
    """Column, row, and the place in that texel in [0, 1]², of the texel that a direction falls in."""
    place = (hemi_octahedral_encode(direction) * 0.5 + 0.5) * size
    texel = np.minimum(place.astype(int), size - 1)
    return int(texel[0]), int(texel[1]), place - texel


def overlap(end, end_normal, receiver, receiver_normal) -> np.ndarray:
    """By how much of its distance a receiver is overlapped by the surface that a ray met at `end`."""
    between = end - receiver
    return np.minimum(dot(between, receiver_normal), dot(between, end_normal)) / length(receiver)


def seen_share(overlapping, bias: float, softness: float) -> np.ndarray:
    """Share of the light that passes."""
    return 1.0 - np.clip((overlapping - bias) / softness, 0.0, 1.0)


def is_silhouette(end: np.ndarray, normal: np.ndarray, farthest: float) -> np.ndarray:
    """[row, column]: whether what a texel met hides what a neighbour met, or the other way round.

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
        result[row, column] = (hides_other | is_hidden).any()
    return result


def vpl_visibility(position, normal, vpl: dict, maps: dict, scene_length: float, bias, softness) -> float:
    """Share of a VPL's light that reaches a receiver.

    Args:
        position, normal: of the receiver, in the world.
        vpl: `position`, `normal`, `footprint`.
        maps: `end`, `normal` [size, size, 3]; `block` [size, size], −1 or the number of a finer block;
            `block_end`, `block_normal` [blocks, refinement, refinement, 3].
    """
    frame = hemisphere_frame(vpl["normal"])
    origin = map_origin(vpl["position"], vpl["normal"], vpl["footprint"])
    receiver = frame @ (position - origin) / scene_length
    receiver_normal = frame @ normal
    if not receiver[2] > 0.0 or not dot(receiver, receiver_normal) < 0.0:
        return 1.0
    column, row, inside = looked_up(receiver, len(maps["end"]))
    block = maps["block"][row, column]
    if block < 0:
        end, end_normal = maps["end"][row, column], maps["normal"][row, column]
    else:
        refinement = maps["block_end"].shape[1]
        fine = np.minimum((inside * refinement).astype(int), refinement - 1)
        end, end_normal = (
            maps["block_end"][block, fine[1], fine[0]],
            maps["block_normal"][block, fine[1], fine[0]],
        )
    return float(seen_share(overlap(end, end_normal, receiver, receiver_normal), bias, softness))
