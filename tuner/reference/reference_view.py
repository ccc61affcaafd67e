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
    """Light that no surface has reflected, from punctual lights, glowing surfaces and the environment.
    Punctual lights cast hard shadows and add no noise; for the others it is the mean of two halves."""
    albedo: Float32[np.ndarray, "height width 3"]
    position_world: Float64[np.ndarray, "height width 3"]
    normal_world: Float32[np.ndarray, "height width 3"]
    """Shading normals of unit length, flipped towards the camera."""
    valid: Bool[np.ndarray, "height width"]
    """Whether the pixel centre sees a surface."""
    samples: int
    """Samples per pixel in each half."""
    direct_noise_floor: float = 0.0
    """The relMSE that the noise of `direct_irradiance` alone causes; 0 if nothing glows."""
    emission: Float32[np.ndarray, "height width 3"] | None = None
    """Radiance that the pixel centre sees of the surface or, where it sees none, of the environment, in
    W/(m² sr). It is no irradiance and in none of the images above. None if nothing glows."""

    @property
    def irradiance(self) -> Float32[np.ndarray, "height width 3"]:
        """Indirect irradiance in W/m², the mean of both halves."""
        return (self.irradiance_a + self.irradiance_b) / np.float32(2.0)


def noise_floor(reference: ReferenceView) -> float:
    """The relMSE that the noise of this reference's indirect light alone causes; 0 if no pixel is valid or
    lit."""
    valid = reference.valid
    return noise_between(reference.irradiance_a[valid], reference.irradiance_b[valid])


def noise_between(a: Float32[np.ndarray, "n 3"], b: Float32[np.ndarray, "n 3"]) -> float:
    """The relMSE that noise causes in the mean of two halves; 0 if nothing is lit.

    relMSE is mean((y − r)²/(r² + 0.01·mean(r)²)) over pixels and channels. With r = (A + B)/2 and independent
    halves, ((A − B)/2)² has the variance of r as its expectation, so it replaces (y − r)².
    """
    a, b = a.astype(np.float64), b.astype(np.float64)
    mean = (a + b) / 2.0
    if not mean.any():
        return 0.0
    return float(np.mean(((a - b) / 2.0) ** 2 / (mean**2 + 0.01 * mean.mean() ** 2)))
