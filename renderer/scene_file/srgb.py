"""The sRGB transfer function (IEC 61966-2-1)."""

import numpy as np
from jaxtyping import Float32


def linear_from_srgb(encoded: Float32[np.ndarray, "*shape"]) -> Float32[np.ndarray, "*shape"]:
    """Linear values of sRGB-encoded ones, both in [0, 1]."""
    low = encoded / np.float32(12.92)
    high = ((encoded + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(encoded <= np.float32(0.04045), low, high).astype(np.float32)
