"""What Mitsuba's texture plugins say: their names, what they scale, and where they lie."""

import numpy as np
from jaxtyping import Float64, UInt8

from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.scene.files.diagnostics import SceneFileError, label
from vpltune.renderer.scene.mitsuba_import.plugin_tree import Plugin

MEAN_ROWS = 64
"""A choice: rows of an image averaged at a time, which are a few MiB."""


def texture_name(texture: Plugin) -> str:
    """What a texture is called in messages: its file, or else its type."""
    if texture.type == "scale":
        return texture_name(within_scale(texture))
    return repr(label(texture.text("filename", texture.type), "?"))


def within_scale(texture: Plugin) -> Plugin:
    """The texture within one of the type 'scale'.

    Raises:
        SceneFileError: there is none.
    """
    within = texture.of_kind("texture")
    if not within:
        raise SceneFileError(f"{texture.where}: must contain a texture")
    return within[0]


def check_bitmap(texture: Plugin) -> None:
    """Refuse a texture that is no bitmap.

    Raises:
        SceneFileError: it is not.
    """
    if texture.type != "bitmap":
        raise SceneFileError(f"{texture.where}: unsupported texture type; must be bitmap or checkerboard")


def linear_mean(texels_srgb: UInt8[np.ndarray, "height width 3"]) -> Float64[np.ndarray, "3"]:
    """The mean of the linear values of all texels."""
    linear = linear_from_srgb(np.arange(256) / 255.0)
    height, width, _ = texels_srgb.shape
    total = np.zeros(3)
    for top in range(0, height, MEAN_ROWS):
        strip = texels_srgb[top : top + MEAN_ROWS].reshape(-1, 3)
        total += [np.bincount(channel, minlength=256) @ linear for channel in strip.T]
    return total / (height * width)


def uv_transform(texture: Plugin) -> Float64[np.ndarray, "3 3"]:
    """The affine transform of texture coordinates: a `to_uv`, or the scales and offsets of version 0.x."""
    if "to_uv" in texture.values:
        matrix = texture.to_world("to_uv")
        return matrix[np.ix_((0, 1, 3), (0, 1, 3))]
    scale = texture.number("uvscale", 1.0)
    result = np.diag([texture.number("uscale", scale), texture.number("vscale", scale), 1.0])
    result[:2, 2] = texture.number("uoffset", 0.0), texture.number("voffset", 0.0)
    return result
