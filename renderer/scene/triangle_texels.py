"""The mean of a texture over each triangle, and how a triangle is cut into equal ones."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float64, Int64

from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.scene.scene import Material, Texture, Wrap

_CUTS = 4
"""Texels are looked up in the middles of this number, squared, of equal pieces of a triangle. A choice."""
_FINER_PLACES = 1024
"""Places in the triangles with the most texels. A choice: a floor of two triangles may have tiles of which 16
places see a few. They are irregular (`_even_places`), so as not to keep step with the tiles."""
_MOST_FINER = 1024
"""How many triangles are cut finer. A choice: a million places, a tenth of a second."""
_AT_A_TIME = 1 << 20
"""Places that are looked up at a time. A choice: about 100 MiB of temporaries."""

Places = Float64[np.ndarray, "triangles places 2"]
"""Texture coordinates."""


def mean_texels(
    texture: Texture, uv: Float64[np.ndarray, "triangles 3 2"], material: Material | None = None
) -> Float64[np.ndarray, "triangles 3"]:
    """The mean linear colour of a texture over each triangle.

    It is that of the nearest texels of 16 places, or of 1,024 in the triangles with the most texels.

    Args:
        texture: the image.
        uv: texture coordinates of the corners.
        material: whose holes count for nothing, and whose see-through places count by their opacity; None
            takes every place alike. So does a triangle that is all hole.
    """

    def looked_up(places: Places) -> Float64[np.ndarray, "triangles places 7"]:
        colors = _colors(texture, places)
        weights = _shares_stopped(texture, material, places)[..., None]
        return np.concatenate([colors, weights * colors, weights], axis=-1)

    means = _means(looked_up, uv, texture)
    plain, weighted, weight = means[:, :3], means[:, 3:6], means[:, 6:]
    return np.where(weight > 0.0, weighted / np.where(weight > 0.0, weight, 1.0), plain)


def mean_stopped_texels(
    texture: Texture | None,
    uv: Float64[np.ndarray, "triangles 3 2"],
    material: Material,
    base: Texture | None,
) -> Float64[np.ndarray, "triangles 3"]:
    """The mean linear colour of a texture times the share of light that the surface stops there.

    Args:
        texture: the image; None is white.
        uv: texture coordinates of the corners.
        material: of the surface.
        base: its base colour texture, whose opacity makes the holes.
    """

    def looked_up(places: Places) -> Float64[np.ndarray, "triangles places 3"]:
        colors = 1.0 if texture is None else _colors(texture, places)
        return colors * (_shares_stopped(base, material, places)[..., None] * np.ones(3))

    return _means(looked_up, uv, texture or base)


def _means(
    looked_up: Callable[[Places], np.ndarray],
    uv: Float64[np.ndarray, "triangles 3 2"],
    texture: Texture | None,
) -> Float64[np.ndarray, "triangles values"]:
    """The mean of what is looked up, over each triangle; with many places where it has most texels of
    `texture`."""
    means = _means_at(looked_up, uv, equal_pieces(_CUTS).mean(axis=1))
    height, width = (1, 1) if texture is None else texture.texels_srgb.shape[:2]
    sides = np.nan_to_num(uv[:, 1:] - uv[:, :1])
    texels = 0.5 * np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]) * width * height
    most = np.argsort(-texels, kind="stable")[:_MOST_FINER]
    finer = most[texels[most] > _CUTS**2]
    if len(finer):
        means[finer] = _means_at(looked_up, uv[finer], _even_places(_FINER_PLACES))
    return means


def _means_at(
    looked_up: Callable[[Places], np.ndarray],
    uv: Float64[np.ndarray, "triangles 3 2"],
    barycentric: Float64[np.ndarray, "places 3"],
) -> Float64[np.ndarray, "triangles values"]:
    step = _AT_A_TIME // len(barycentric)
    means = []
    for start in range(0, max(1, len(uv)), step):
        places = np.einsum("kw,twa->tka", barycentric, uv[start : start + step])
        means.append(looked_up(places).mean(axis=1))
    return np.concatenate(means)


def _even_places(count: int) -> Float64[np.ndarray, "places 3"]:
    """Barycentric coordinates of places that fill a triangle evenly, in no regular order.

    Points of the R2 sequence (Roberts 2018), which steps by the inverse powers of the root of x³ = x + 1.
    """
    root = 1.32471795724474602596
    u, v = ((0.5 + np.arange(1, count + 1) * root**-power) % 1.0 for power in (1.0, 2.0))
    return np.stack([1.0 - np.sqrt(u), np.sqrt(u) * (1.0 - v), np.sqrt(u) * v], axis=1)


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


def _colors(texture: Texture, places: Places) -> Float64[np.ndarray, "triangles places 3"]:
    return linear_from_srgb(texture.texels_srgb[_nearest_texels(texture, places)] / 255.0)


def _shares_stopped(
    texture: Texture | None, material: Material | None, places: Places
) -> Float64[np.ndarray, "triangles places"]:
    """Share of the light in [0, 1] that the surface stops at each place: 0 in a hole."""
    if material is None or material.is_opaque:
        return np.ones(places.shape[:2])
    opacity = np.full(places.shape[:2], float(material.opacity))
    if texture is not None and texture.opacity is not None:
        opacity *= texture.opacity[_nearest_texels(texture, places)] / 255.0
    return opacity if material.is_blended else (opacity >= material.alpha_cutoff).astype(np.float64)


def _nearest_texels(
    texture: Texture, uv: Places
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
