"""Environment maps from files: OpenEXR and Radiance .hdr."""

import math

import numpy as np
from jaxtyping import Float32

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.exr_pixels import exr_channels
from vpltune.renderer.scene.files.limits import LARGEST_RADIOMETRIC
from vpltune.renderer.scene.files.radiance_hdr import hdr_pixels

ENVIRONMENT_SUFFIXES = (".exr", ".hdr")
"""Suffixes of the maps that are read."""


def is_environment_file(name: str) -> bool:
    """Whether a name has one of the suffixes."""
    return name.lower().endswith(ENVIRONMENT_SUFFIXES)


def environment_planes(
    content: bytes, name: str, scale: float, where: str
) -> list[Float32[np.ndarray, "height width"]]:
    """The radiance of an equirectangular map in W/(m² sr), times `scale`: red, green and blue.

    Args:
        content: the file.
        name: of the file; its suffix says the format.
        scale: a factor ≥ 0.
        where: the place in the scene's file, for messages.

    Raises:
        SceneFileError: the file is broken or too large, or a radiance is negative, not finite or too large.
    """
    if not (0.0 <= scale < math.inf):
        raise SceneFileError(f"{where}: the scale must be finite and ≥ 0, got {scale:g}")
    if name.lower().endswith(".hdr"):
        pixels = hdr_pixels(content, where)
        planes = [pixels[..., channel] for channel in range(3)]
    else:
        # Three arrays as they are: joined, the largest maps would take too much memory.
        planes = exr_channels(content, where)
    brightest = scale * max(float(plane.max()) for plane in planes)
    if not brightest <= LARGEST_RADIOMETRIC:
        raise SceneFileError(
            f"{where}: radiance must be at most {LARGEST_RADIOMETRIC:g} W/(m² sr), got {brightest:g}"
        )
    return planes if scale == 1.0 else [plane * np.float32(scale) for plane in planes]
