"""Products of texture images: a base colour dimmed by another image, such as the metalness of its texels."""

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from vpltune.renderer.files.srgb import linear_from_srgb, srgb_from_linear

# A choice: rows multiplied at a time. Indices into the table take 24 times the memory of their texels.
_STRIP_ROWS = 64


def dimmed(
    texels_srgb: UInt8[np.ndarray, "height width 3"], plane: UInt8[np.ndarray, "height width"], factor: float
) -> UInt8[np.ndarray, "height width 3"]:
    """sRGB bytes of: linear colour · (1 − factor · plane / 255). Where that is 1, texels keep their bytes."""
    step = np.arange(256) / 255.0
    table = linear_from_srgb(step)[:, None] * (1.0 - factor * step)[None, :]
    products = np.round(255.0 * srgb_from_linear(table)).astype(np.uint8)
    result = np.empty_like(texels_srgb)
    for top in range(0, len(result), _STRIP_ROWS):
        rows = slice(top, top + _STRIP_ROWS)
        result[rows] = products[texels_srgb[rows], plane[rows, :, None]]
    return result


def of_size(image: UInt8[np.ndarray, "*image"], width: int, height: int) -> UInt8[np.ndarray, "*resized"]:
    """The image resampled bilinearly; itself where it has this size."""
    if image.shape[:2] == (height, width):
        return image
    return np.asarray(Image.fromarray(image).resize((width, height), Image.Resampling.BILINEAR))
