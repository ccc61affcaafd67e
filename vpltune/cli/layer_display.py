"""Layers of an image as a screen shows them."""

import numpy as np

from vpltune.cli.options import Layer
from vpltune.renderer.files.srgb import srgb_from_linear
from vpltune.renderer.frame.runtime import Runtime


def for_display(
    runtime: Runtime, layer: Layer, pixels: np.ndarray, exposure: float | None = None
) -> np.ndarray:
    """A layer as display-referred colours, uint8 or floats in [0, 1], in the way it is usually looked at.

    `exposure` None measures it from the image.
    """
    if layer in ("direct", "indirect", "irradiance"):
        return runtime.display(pixels, exposure)
    if layer == "albedo":
        return srgb_from_linear(pixels)
    if layer == "normal":
        return 0.5 + 0.5 * pixels
    if layer == "depth":
        # Nearest over depth: white is nearest, black is nothing, and no unit is involved.
        seen = pixels > 0.0
        nearest = pixels[seen].min() if seen.any() else 1.0
        shown = np.divide(nearest, pixels, out=np.zeros_like(pixels), where=seen)
        return np.repeat(shown[..., None], 3, axis=2)
    return pixels
