"""Converts the layers of an image to display colours."""

import numpy as np

from vpltune.renderer.files.srgb import srgb_from_linear
from vpltune.renderer.frame.runtime import Layer, Runtime


def for_display(
    runtime: Runtime, layer: Layer, pixels: np.ndarray, exposure: float | None = None
) -> np.ndarray:
    """Convert a layer to display colours.

    Radiance and irradiance are exposed and tone-mapped, albedo is encoded as sRGB, normals are mapped to
    [0, 1], and depth becomes the nearest depth over the depth.

    Args:
        runtime: exposes and tone-maps.
        layer: the layer that `pixels` are.
        pixels: [height, width, 3], or [height, width] for depth, as `Runtime.render` returns them.
        exposure: factor of radiance and irradiance; None measures it from the image.

    Returns:
        [height, width, 3], uint8 or float in [0, 1].
    """
    if layer in ("direct", "indirect", "irradiance"):
        return runtime.display(pixels, exposure)
    if layer == "albedo":
        return srgb_from_linear(pixels)
    if layer == "normal":
        return 0.5 + 0.5 * pixels
    if layer == "depth":
        # Without unit: white is the nearest surface, black is no surface.
        seen = pixels > 0.0
        nearest = pixels[seen].min() if seen.any() else 1.0
        shown = np.divide(nearest, pixels, out=np.zeros_like(pixels), where=seen)
        return np.repeat(shown[..., None], 3, axis=2)
    return pixels
