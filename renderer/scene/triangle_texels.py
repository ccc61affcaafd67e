"""The mean of a texture over each triangle, and how a triangle is cut into equal ones."""

import numpy as np
from jaxtyping import Float64, Int64

from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.scene.scene import Material, Texture, Wrap

_CUTS = 4
"""Texels are looked up in the middles of this number, squared, of equal pieces of a triangle. A choice."""
_FINER_CUTS = 31
"""The same for the triangles with the most texels. A choice: a floor of two triangles may have tiles of which
16 places see a few. A prime, so that places do not keep step with the tiles."""
_MOST_FINER = 1024
"""How many triangles are cut finer. A choice: a million places, a tenth of a second."""
_AT_A_TIME = 1 << 20
"""Places that are looked up at a time. A choice: about 100 MiB of temporaries."""


def mean_texels(
    texture: Texture, uv: Float64[np.ndarray, "triangles 3 2"], material: Material | None = None
) -> Float64[np.ndarray, "triangles 3"]:
    """The mean linear colour of a texture over each triangle.

    It is that of the nearest texels of 16 places, or of 961 in the triangles with the most texels.

    Args:
        texture: the image.
        uv: texture coordinates of the corners.
        material: whose holes count for nothing, and whose see-through places count by their opacity; None
            takes every place alike. So does a triangle that is all hole.
    """
    means = _means_of_pieces(texture, uv, material, _CUTS)
    height, width, _ = texture.texels_srgb.shape
    sides = np.nan_to_num(uv[:, 1:] - uv[:, :1])
    texels = 0.5 * np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]) * width * height
    most = np.argsort(-texels, kind="stable")[:_MOST_FINER]
    finer = most[texels[most] > _CUTS**2]
    means[finer] = _means_of_pieces(texture, uv[finer], material, _FINER_CUTS)
    return means


def _means_of_pieces(
    texture: Texture, uv: Float64[np.ndarray, "triangles 3 2"], material: Material | None, cuts: int
) -> Float64[np.ndarray, "triangles 3"]:
    means = np.empty((len(uv), 3))
    middles = equal_pieces(cuts).mean(axis=1)
    step = _AT_A_TIME // len(middles)
    for start in range(0, len(uv), step):
        rows = slice(start, start + step)
        places = np.einsum("kw,twa->tka", middles, uv[rows])
        line, column = _nearest_texels(texture, places)
        colors = linear_from_srgb(texture.texels_srgb[line, column] / 255.0)
        weights = _weights(texture, material, line, column)
        total = weights.sum(axis=1, keepdims=True)
        weights = np.where(total > 0.0, weights, 1.0)
        means[rows] = (colors * weights[..., None]).sum(axis=1) / weights.sum(axis=1, keepdims=True)
    return means


def equal_pieces(count: int) -> Float64[np.ndarray, "pieces 3 3"]:
    """Barycentric coordinates of the corners of count² equal pieces of a triangle, which keep its winding."""
    pieces = []
    for row in range(count):
        for column in range(count - row):
            low, right, up = (column, row), (column + 1, row), (column, row + 1)
            pieces.append([low, right, up])
            if column + row + 2 <= count:
                pieces.append([right, (column + 1, row + 1), up])
    place = np.array(pieces, np.float64) / count
    return np.concatenate([1.0 - place.sum(axis=2, keepdims=True), place], axis=2)


def _weights(
    texture: Texture, material: Material | None, line: np.ndarray, column: np.ndarray
) -> Float64[np.ndarray, "triangles places"]:
    if material is None or material.is_opaque or texture.opacity is None:
        return np.ones(line.shape)
    opacity = material.opacity * texture.opacity[line, column] / 255.0
    return opacity if material.is_blended else (opacity >= material.alpha_cutoff).astype(np.float64)


def _nearest_texels(
    texture: Texture, uv: Float64[np.ndarray, "triangles places 2"]
) -> tuple[Int64[np.ndarray, "triangles places"], Int64[np.ndarray, "triangles places"]]:
    """Row and column of the texel next to each place."""
    height, width, _ = texture.texels_srgb.shape
    uv = np.nan_to_num(uv)
    return _texel(uv[..., 1], height, texture.wrap_v), _texel(uv[..., 0], width, texture.wrap_u)


def _texel(coordinate: Float64[np.ndarray, "*shape"], size: int, wrap: Wrap) -> Int64[np.ndarray, "*shape"]:
    if wrap == "repeat":
        coordinate = coordinate % 1.0
    elif wrap == "mirrored_repeat":
        coordinate = 1.0 - np.abs(coordinate % 2.0 - 1.0)
    return np.clip(np.floor(np.clip(coordinate, 0.0, 1.0) * size), 0, size - 1).astype(np.int64)
