"""The reference of one view, and the noise left in it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float32, Float64


@dataclass(frozen=True, eq=False)
class ReferenceView:
    """Irradiance (W/m²) and surfaces at the pixel centres of a view; row 0 is the top.

    Images are zero where a pixel sees no surface. Positions are in world units.
    """

    irradiance_a: Float32[np.ndarray, "height width 3"]
    """Indirect irradiance. The two halves, a and b, are independent unbiased estimates of it."""
    irradiance_b: Float32[np.ndarray, "height width 3"]
    direct_irradiance: Float32[np.ndarray, "height width 3"]
    """Free of noise, since punctual lights cast hard shadows."""
    albedo: Float32[np.ndarray, "height width 3"]
    position_world: Float64[np.ndarray, "height width 3"]
    normal_world: Float32[np.ndarray, "height width 3"]
    """Shading normals of unit length, flipped towards the camera."""
    valid: Bool[np.ndarray, "height width"]
    """Whether the pixel centre sees a surface."""
    samples: int
    """Samples per pixel in each half."""

    @property
    def irradiance(self) -> Float32[np.ndarray, "height width 3"]:
        """Indirect irradiance in W/m², the mean of both halves."""
        return (self.irradiance_a + self.irradiance_b) / np.float32(2.0)


def noise_floor(reference: ReferenceView) -> float:
    """The relMSE that the noise of this reference alone causes; 0 if no pixel is valid or lit.

    relMSE is mean((y − r)²/(r² + 0.01·mean(r)²)) over valid pixels and channels. With r = (A + B)/2 and
    independent halves, ((A − B)/2)² has the variance of r as its expectation, so it replaces (y − r)².
    """
    a = reference.irradiance_a[reference.valid].astype(np.float64)
    b = reference.irradiance_b[reference.valid].astype(np.float64)
    mean = (a + b) / 2.0
    if not mean.any():
        return 0.0
    return float(np.mean(((a - b) / 2.0) ** 2 / (mean**2 + 0.01 * mean.mean() ** 2)))
