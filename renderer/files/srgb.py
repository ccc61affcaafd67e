"""The sRGB transfer curve (IEC 61966-2-1:1999), and luminance."""

import numpy as np
from jaxtyping import Float

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Luminance of linear sRGB primaries (ITU-R BT.709)."""


def srgb_from_linear(linear: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Encode linear values as sRGB. Values outside [0, 1] are clamped first."""
    clamped = np.clip(linear, 0.0, 1.0)
    encoded = np.where(clamped <= 0.0031308, 12.92 * clamped, 1.055 * clamped ** (1.0 / 2.4) - 0.055)
    return encoded.astype(linear.dtype)


def linear_from_srgb(encoded: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Decode sRGB values in [0, 1] to linear values."""
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return linear.astype(encoded.dtype)
