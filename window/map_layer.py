"""The layers `rsm` and `maps`: what the lights see, and what each VPL sees, as one sheet of tiles."""

import math

import numpy as np
from jaxtyping import Float, UInt8

from vpltune.renderer.files.srgb import srgb_from_linear
from vpltune.renderer.frame.capture import VisibilityMaps

REFINED = (200, 90, 30)
"""Colour of the texels in whose place a block of finer ones stands, sRGB. A choice."""
FARTHEST = 2.0
"""Distance in units of L that is shown as black. A choice: L is about half a room."""


def rsm_mosaic(
    reflectance: Float[np.ndarray, "rows columns 3"], size: tuple[int, int]
) -> UInt8[np.ndarray, "height width 3"]:
    """The RSM atlas as the lights see it, in the colours of the surfaces, fitted into `size`."""
    step = max(1, math.ceil(max(reflectance.shape[1] / size[0], reflectance.shape[0] / size[1])))
    colors = srgb_from_linear(np.clip(reflectance[::step, ::step].astype(np.float32), 0.0, 1.0))
    return _centered(np.round(colors * 255.0).astype(np.uint8), size)


def map_mosaic(maps: VisibilityMaps | None, size: tuple[int, int]) -> UInt8[np.ndarray, "height width 3"]:
    """The map of each VPL in a grid: near surfaces are bright, nothing is black, refined texels orange."""
    if maps is None:
        return np.zeros((size[1], size[0], 3), np.uint8)
    count, side, _ = maps.corner.shape
    columns = max(1, math.ceil(math.sqrt(count * size[0] / size[1])))
    rows = math.ceil(count / columns)
    near = np.clip(1.0 - maps.distance / FARTHEST, 0.0, 1.0)
    tiles = np.zeros((rows * columns, side, side, 3), np.uint8)
    tiles[:count] = np.round(near * 255.0).astype(np.uint8)[..., None]
    tiles[:count][maps.block >= 0] = REFINED
    sheet = tiles.reshape(rows, columns, side, side, 3).transpose(0, 2, 1, 3, 4)
    sheet = sheet.reshape(rows * side, columns * side, 3)
    step = max(1, math.ceil(max(sheet.shape[1] / size[0], sheet.shape[0] / size[1])))
    return _centered(np.ascontiguousarray(sheet[::step, ::step]), size)


def _centered(
    image: UInt8[np.ndarray, "rows columns 3"], size: tuple[int, int]
) -> UInt8[np.ndarray, "height width 3"]:
    """The image in the middle of a black one of `size`, enlarged by a whole factor where it fits."""
    width, height = size
    factor = max(1, min(width // image.shape[1], height // image.shape[0]))
    image = image.repeat(factor, axis=0).repeat(factor, axis=1)[:height, :width]
    whole = np.zeros((height, width, 3), np.uint8)
    top, left = (height - image.shape[0]) // 2, (width - image.shape[1]) // 2
    whole[top : top + image.shape[0], left : left + image.shape[1]] = image
    return whole
