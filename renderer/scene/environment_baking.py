"""Turns and shrinks equirectangular maps, and keeps the light that they hold."""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float32, Float64

from vpltune.renderer.scene.environment import Environment, solid_angles

MOST_ROWS, MOST_COLUMNS = 512, 1024
"""A choice: the largest map that is drawn, 0.35° for each texel. A sun of 0.5° keeps its flux."""
# A choice: rows and columns that a map has at least before it is turned, lest its texels be seen to turn.
_LEAST_ROWS, _LEAST_COLUMNS = 128, 256
# A choice: looked-up directions in each texel of a turned map, along each of its sides.
_LOOKUPS = 3
# A choice: what is this many times the mean is carried over as flux, not looked up: a sun of one texel may
# lie between all directions.
_BRIGHT = 8.0
# A choice: parts of a bright texel along each of its sides, each of which is carried over by itself.
_PARTS = 8
# Turns smaller than this, in radians, are rounding. A choice.
_NO_TURN = 1e-7
Map = Float32[np.ndarray, "height width 3"]
# A map that is made, of another size than the one it is made of.
_Made = Float32[np.ndarray, "rows columns 3"]
Planes = Sequence[Float32[np.ndarray, "height width"]]
"""Red, green and blue of a map."""


def baked_environment(radiance: Planes, to_world: Float64[np.ndarray, "3 3"] | None = None) -> Environment:
    """The environment of a map, in the world's axes and at most 1024 × 512 texels.

    Larger maps are averaged over texels by solid angle. What is turned about +Y alone moves by columns. Any
    other turn looks up directions; texels far above the mean are carried over instead, each by its flux. The
    mean radiance stays the same.

    Args:
        radiance: red, green and blue, each [height, width] as in `Environment`; finite and ≥ 0.
        to_world: the rotation, or mirrored rotation, from the map's axes to the world's; None for none.
    """
    turn = np.eye(3) if to_world is None else to_world
    if radiance[0].size == 1 or np.abs(turn - np.eye(3)).max() < _NO_TURN:
        return Environment(_shrunk(radiance))
    about_y = np.abs(turn[1] - (0.0, 1.0, 0.0)).max() < _NO_TURN and np.linalg.det(turn) > 0.0
    if about_y:
        # A rotation by θ about +Y takes −Z, azimuth 0, to the azimuth −θ.
        azimuth = math.atan2(turn[0, 2], turn[2, 2])
        return Environment(_shrunk(radiance, -azimuth))
    return Environment(_turned(_shrunk(radiance), turn))


def _shrunk(radiance: Planes, azimuth: float = 0.0) -> _Made:
    """The map with its columns moved by an azimuth, averaged to the largest size that is drawn."""
    height, width = radiance[0].shape
    shift = azimuth / (2.0 * math.pi) * width
    moves_whole = abs(shift - round(shift)) < _NO_TURN * width
    if height <= MOST_ROWS and width <= MOST_COLUMNS and moves_whole:
        return np.roll(np.stack(radiance, axis=-1), round(shift), axis=1)
    columns = min(max(width, 1 if moves_whole else _LEAST_COLUMNS), MOST_COLUMNS)
    rows = min(height, MOST_ROWS)
    edges = np.linspace(0.0, height, rows + 1)
    across = np.linspace(0.0, width, columns + 1) - shift
    result = np.empty((rows, columns, 3), np.float32)
    for row in range(rows):
        first, last = math.floor(edges[row]), min(math.ceil(edges[row + 1]), height)
        inside = np.clip(np.arange(first, last + 1), edges[row], edges[row + 1])
        weights = -np.diff(np.cos(np.pi * inside / height))
        weights /= weights.sum()
        line = np.stack([weights @ plane[first:last] for plane in radiance], axis=-1)
        result[row] = _averages(line, across)
    return result


def _averages(
    line: Float64[np.ndarray, "width 3"], edges: Float64[np.ndarray, " edges"]
) -> Float64[np.ndarray, "columns 3"]:
    """Means of a periodic row of texels between edges, which are in texels and ascend over one period."""
    width = len(line)
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(line, axis=0)])
    turns, within = np.divmod(edges, width)
    texel = np.minimum(within.astype(np.int64), width - 1)
    integral = sums[texel] + (within - texel)[:, None] * line[texel] + turns[:, None] * sums[-1]
    # Sums of float64 may fall by rounding.
    return np.maximum(np.diff(integral, axis=0), 0.0) / np.diff(edges)[:, None]


def _turned(radiance: Map, to_world: Float64[np.ndarray, "3 3"]) -> _Made:
    rows, columns = max(radiance.shape[0], _LEAST_ROWS), max(radiance.shape[1], _LEAST_COLUMNS)
    source = Environment(radiance)
    most = np.float32(_BRIGHT * float(source.mean_radiance().mean()))
    even = np.minimum(radiance, most)
    result = np.empty((rows, columns, 3))
    steps = (np.arange(_LOOKUPS) + 0.5) / _LOOKUPS
    azimuth = 2.0 * np.pi * (np.arange(columns)[:, None] + steps).ravel() / columns
    edges = np.cos(np.pi * np.arange(rows + 1) / rows)
    for row in range(rows):
        cosine = edges[row] + (edges[row + 1] - edges[row]) * steps
        directions = _directions(cosine, azimuth) @ to_world
        looked_up = even[_texels_of(directions, *radiance.shape[:2])]
        result[row] = looked_up.reshape(_LOOKUPS, columns, _LOOKUPS, 3).mean(axis=(0, 2), dtype=np.float64)
    # Lookups miss the mean by little.
    angles = solid_angles(rows, columns)[:, None, None]
    there = np.einsum("hwc,hxy->c", result, angles) / (4.0 * np.pi)
    here = Environment(even).mean_radiance()
    result *= np.divide(here, there, out=np.ones(3), where=there > 0.0)
    _carry(radiance - even, to_world, result, angles)
    return result.astype(np.float32)


def _carry(
    bright: Map,
    to_world: Float64[np.ndarray, "3 3"],
    result: Float64[np.ndarray, "rows columns 3"],
    angles: Float64[np.ndarray, "rows 1 1"],
) -> None:
    """Add the flux of bright texels to where they are turned."""
    height, width, _ = bright.shape
    size = result.shape[:2]
    row, column = np.nonzero(bright.any(axis=2))
    flux = bright[row, column] * solid_angles(height, width)[row, None] / _PARTS**2
    steps = (np.arange(_PARTS) + 0.5) / _PARTS
    top, bottom = np.cos(np.pi * row / height), np.cos(np.pi * (row + 1) / height)
    for down in steps:
        cosine = top + (bottom - top) * down
        sine = np.sqrt(np.maximum(1.0 - cosine**2, 0.0))
        for along in steps:
            azimuth = 2.0 * np.pi * (column + along) / width
            towards = np.stack([sine * np.sin(azimuth), cosine, -sine * np.cos(azimuth)], axis=-1)
            there = np.ravel_multi_index(_texels_of(towards @ to_world.T, *size), size)
            for channel in range(3):
                arrived = np.bincount(there, flux[:, channel], size[0] * size[1])
                result[..., channel] += arrived.reshape(size) / angles[..., 0]


def _directions(
    cosine: Float64[np.ndarray, " rows"], azimuth: Float64[np.ndarray, " columns"]
) -> Float64[np.ndarray, "rows columns 3"]:
    sine = np.sqrt(1.0 - cosine**2)
    directions = np.empty((len(cosine), len(azimuth), 3))
    directions[..., 0] = np.outer(sine, np.sin(azimuth))
    directions[..., 1] = cosine[:, None]
    directions[..., 2] = -np.outer(sine, np.cos(azimuth))
    return directions


def _texels_of(
    directions: Float64[np.ndarray, "*rays 3"], height: int, width: int
) -> tuple[np.ndarray, np.ndarray]:
    """Row and column of the texel in each direction."""
    polar = np.arccos(np.clip(directions[..., 1], -1.0, 1.0)) / np.pi
    turn = np.arctan2(directions[..., 0], -directions[..., 2]) / (2.0 * np.pi) % 1.0
    row = np.minimum((polar * height).astype(np.int64), height - 1)
    return row, np.minimum((turn * width).astype(np.int64), width - 1)
