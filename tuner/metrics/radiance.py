"""Radiance of diffuse surfaces."""

import numpy as np
from jaxtyping import Float32


def radiance(
    albedo: Float32[np.ndarray, "height width 3"],
    direct_irradiance: Float32[np.ndarray, "height width 3"],
    indirect_irradiance: Float32[np.ndarray, "height width 3"],
) -> Float32[np.ndarray, "height width 3"]:
    """L = ρ/π · (E_direct + E_indirect) [W/(m²·sr)]. Twin: shaders/display/material_resolve.comp."""
    return (albedo / np.float32(np.pi) * (direct_irradiance + indirect_irradiance)).astype(np.float32)
