"""The error that a fit minimises: relative, masked by direct light, and robust against outliers.

The weight of each value of a view is

    w = (1 − p)/(r² + 0.01·m²) + p/((r + d)² + 0.01·m²),    p = MASKED_SHARE

where r is the indirect and d the direct irradiance of the reference, and m is the mean of r over the view.
The first term is that of relMSE. The second relates the error to all light at the pixel, as the eye and FLIP
do: strong direct light masks it. The weights depend on the reference alone and are computed once.

A few dark pixels with light leaks dominate relMSE, and a few bright pixels dominate plain squared error. So
the error of a pixel, e = √mean_c(w·(y − r)²), enters through the pseudo-Huber function

    ρ(e) = 2s²·(√(1 + (e/s)²) − 1)

It is e² for e ≪ s and grows like 2s·e beyond (Charbonnier et al. 1997, "Deterministic edge-preserving
regularization in computed imaging"). The scale s is the median of e over the view for the image that the fit
starts from. It is the same for all candidates, so their costs are comparable. Iteratively reweighted least
squares with the weights ρ′(e)/(2e) = 1/√(1 + (e/s)²) reduces Σρ in every step (Holland and Welsch 1977). Each
step is the least-squares problem of `tuner.surrogate.reduced_gather`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64

from vpltune.tuner.metrics.relative_squared_error import DARK_SHARE

MASKED_SHARE = 0.5
"""p, the weight of the second term. A choice: on nine development scenes, 0, ½ and 1 gave held-out relMSE and
FLIP within 2 % of each other."""
LEAST_SCALE = 1e-4
"""Lower limit of s, relative. A choice: errors below 0.01 % are rounding."""


@dataclass(frozen=True, eq=False)
class RobustError:
    """The robust error of images of one view. An image is the indirect irradiance at the receivers."""

    reference: Float64[np.ndarray, "receivers 3"]
    """r [W/m²]."""
    weight: Float64[np.ndarray, "receivers 3"]
    """w [1/(W/m²)²]; zero in a black view."""
    scale: float
    """s, relative."""

    def costs(self, image: Float[np.ndarray, "receivers 3"]) -> Float64[np.ndarray, " receivers"]:
        """ρ at each receiver for an image y [W/m²]; relative, ≥ 0."""
        return 2.0 * self.scale**2 * (np.hypot(1.0, self._error(image) / self.scale) - 1.0)

    def cost(self, image: Float[np.ndarray, "receivers 3"]) -> float:
        """Mean of ρ over the receivers for an image y [W/m²]; 0 without receivers."""
        return float(self.costs(image).mean()) if len(image) else 0.0

    def weights(self, image: Float[np.ndarray, "receivers 3"]) -> Float64[np.ndarray, "receivers 3"]:
        """Weight of each value in the next least-squares step, ÷ number of values [1/(W/m²)²]."""
        robust = 1.0 / np.hypot(1.0, self._error(image) / self.scale)
        return self.weight * robust[:, None] / max(self.weight.size, 1)

    def _error(self, image: Float[np.ndarray, "receivers 3"]) -> Float64[np.ndarray, " receivers"]:
        return np.sqrt((self.weight * (image.astype(np.float64) - self.reference) ** 2).mean(axis=1))


def robust_error(
    reference: Float[np.ndarray, "receivers 3"],
    direct: Float[np.ndarray, "receivers 3"],
    start: Float[np.ndarray, "receivers 3"],
) -> RobustError:
    """The robust error of one view.

    Args:
        reference: Indirect irradiance of the reference [W/m²].
        direct: Direct irradiance of the reference [W/m²].
        start: Indirect irradiance at the start of the fit [W/m²], which sets the scale s.
    """
    r, d = reference.astype(np.float64), direct.astype(np.float64)
    level = r.mean() ** 2 if r.size else 0.0
    weight = np.zeros_like(r)
    if level > 0.0:
        dark = DARK_SHARE * level
        weight = (1.0 - MASKED_SHARE) / (r**2 + dark) + MASKED_SHARE / ((r + d) ** 2 + dark)
    counted = RobustError(r, weight, 1.0)
    errors = counted._error(start)
    return RobustError(r, weight, max(float(np.median(errors)) if errors.size else 0.0, LEAST_SCALE))
