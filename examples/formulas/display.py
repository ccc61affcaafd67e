"""From radiance to what a display shows: docs/runtime_formulas.md, "Exposure and tone curve"."""

import numpy as np

from examples.formulas.vectors import dot

EXPOSURE_KEY = 0.25


def measured_exposure(radiance: np.ndarray, covered: np.ndarray) -> float:
    """Brings the mean luminance of the covered pixels to `EXPOSURE_KEY`; 1 for a black image."""
    luminance = float((dot(radiance, np.array([0.2126, 0.7152, 0.0722])) * covered).sum())
    return EXPOSURE_KEY * float(covered.sum()) / luminance if luminance > 0.0 else 1.0


def tone_curve(color: np.ndarray) -> np.ndarray:
    """Khronos PBR Neutral (2024)."""
    start, desaturation = 0.8 - 0.04, 0.15
    low = color.min(axis=-1, keepdims=True)
    color = color - np.where(low < 0.08, low - 6.25 * low**2, 0.04)
    peak = color.max(axis=-1, keepdims=True)
    room = 1.0 - start
    new_peak = 1.0 - room**2 / np.maximum(peak + room - start, room)
    white = 1.0 - 1.0 / (desaturation * (peak - new_peak) + 1.0)
    bent = color * new_peak / np.maximum(peak, 1e-30) * (1.0 - white) + new_peak * white
    return np.where(peak < start, color, bent)


def srgb_encode(linear: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1."""
    linear = np.clip(linear, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
