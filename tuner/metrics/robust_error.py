"""The error that a fit minimises: relative, masked by direct light, and robust against single pixels.

Each value of a view weighs

    w = (1 − p)/(r² + 0.01·m²) + p/((r + d)² + 0.01·m²),    p = MASKED_SHARE

with r the reference's indirect and d its direct irradiance and m the view's mean of r. The first term is that
of relMSE. The second measures the error beside all the light at the pixel, as the eye and FLIP do: strong
direct light masks it. Both are made once, from the reference alone.

relMSE alone is ruled by a few dark pixels that leak, and plain squared error by a few bright ones. So a
pixel's error e = √mean_c(w·(y − r)²) counts by the pseudo-Huber function

    ρ(e) = 2s²·(√(1 + (e/s)²) − 1)

which is e² for e ≪ s and grows as 2s·e beyond (Charbonnier et al. 1997, "Deterministic edge-preserving
regularization in computed imaging"). The scale s is the median of e over the view in the image that the fit
starts from, one for all candidates, so that their costs compare. Iteratively reweighted least squares with
the weights ρ′(e)/(2e) = 1/√(1 + (e/s)²) lowers Σρ at every step (Holland and Welsch 1977), and each step is
the least-squares problem of `tuner.surrogate.reduced_gather`.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float64

from vpltune.tuner.metrics.relative_squared_error import DARK_SHARE

MASKED_SHARE = 0.5
"""Weight of the error beside all light. A choice: over nine scenes of development, 0, ½ and 1 left held-out
relMSE and FLIP within 2 % of each other."""
LEAST_SCALE = 1e-4
"""The least scale, relative: below 0.01 % errors are rounding."""


@dataclass(frozen=True, eq=False)
class RobustError:
    """How the errors of one view are counted."""

    reference: Float64[np.ndarray, "receivers 3"]
    """r [W/m²]."""
    weight: Float64[np.ndarray, "receivers 3"]
    """w [1/(W/m²)²]; zero in a black view."""
    scale: float
    """s, relative."""

    def costs(self, image: Float[np.ndarray, "receivers 3"]) -> Float64[np.ndarray, " receivers"]:
        """ρ at every receiver for an image y [W/m²]."""
        return 2.0 * self.scale**2 * (np.hypot(1.0, self._error(image) / self.scale) - 1.0)

    def cost(self, image: Float[np.ndarray, "receivers 3"]) -> float:
        """The mean of ρ over the receivers for an image y [W/m²]; 0 without receivers."""
        return float(self.costs(image).mean()) if len(image) else 0.0

    def weights(self, image: Float[np.ndarray, "receivers 3"]) -> Float64[np.ndarray, "receivers 3"]:
        """What each value of the image weighs in the next least-squares step, over the number of values."""
        robust = 1.0 / np.hypot(1.0, self._error(image) / self.scale)
        return self.weight * robust[:, None] / max(self.weight.size, 1)

    def _error(self, image: Float[np.ndarray, "receivers 3"]) -> Float64[np.ndarray, " receivers"]:
        return np.sqrt((self.weight * (image.astype(np.float64) - self.reference) ** 2).mean(axis=1))


def robust_error(
    reference: Float[np.ndarray, "receivers 3"],
    direct: Float[np.ndarray, "receivers 3"],
    start: Float[np.ndarray, "receivers 3"],
) -> RobustError:
    """How errors count in a view with these irradiances [W/m²], `start` being the image that a fit begins
    with."""
    r, d = reference.astype(np.float64), direct.astype(np.float64)
    level = r.mean() ** 2 if r.size else 0.0
    weight = np.zeros_like(r)
    if level > 0.0:
        dark = DARK_SHARE * level
        weight = (1.0 - MASKED_SHARE) / (r**2 + dark) + MASKED_SHARE / ((r + d) ** 2 + dark)
    counted = RobustError(r, weight, 1.0)
    errors = counted._error(start)
    return RobustError(r, weight, max(float(np.median(errors)) if errors.size else 0.0, LEAST_SCALE))
