"""Tone mapping in numpy: the twin of shaders/display/tone_mapping.comp and of templates/scene.js."""

import numpy as np
from jaxtyping import Float, UInt8

from vpltune.renderer.files.srgb import srgb_from_linear


def display_image(
    linear: Float[np.ndarray, "height width 3"], exposure: float
) -> UInt8[np.ndarray, "height width 3"]:
    """`linear` × `exposure`, tone-mapped and encoded as 8-bit sRGB."""
    encoded = srgb_from_linear(tone_curve(linear.astype(np.float64) * exposure))
    return np.round(255.0 * encoded).astype(np.uint8)


def tone_curve(color: Float[np.ndarray, "*shape 3"]) -> Float[np.ndarray, "*shape 3"]:
    """Khronos PBR Neutral (2024): maps linear light, ≥ 0, to [0, 1]."""
    start_compression = 0.8 - 0.04
    desaturation = 0.15
    low = color.min(axis=-1, keepdims=True)
    color = color - np.where(low < 0.08, low - 6.25 * low * low, 0.04)
    peak = color.max(axis=-1, keepdims=True)
    room = 1.0 - start_compression
    # The clamp avoids a division by zero where the peak is 0. Values below the shoulder are not used.
    shoulder_peak = np.maximum(peak, start_compression)
    new_peak = 1.0 - room * room / (shoulder_peak + room - start_compression)
    towards_white = 1.0 - 1.0 / (desaturation * (shoulder_peak - new_peak) + 1.0)
    compressed = color * (new_peak / shoulder_peak)
    return np.where(peak < start_compression, color, compressed + (new_peak - compressed) * towards_white)
