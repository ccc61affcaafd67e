"""Weighted squared error against a noisy reference, without fitting its noise.

    relMSE(y, r) = mean((y − r)² / (r² + 0.01·mean(r)²))

over valid pixels and channels. With r = (a + b)/2 from two independent halves, (y − r)² holds the noise of
r as well; (y − a)(y − b) has the same expectation without it, since the noise of a and of b multiply to
zero in the mean.

A fit does not minimise relMSE itself, which a few pixels can rule, but reweights the pixels for robustness
(`tuner.metrics.robust_error`).
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

DARK_SHARE = 0.01
"""Share of the squared mean that is added to r²: a black pixel must not weigh infinitely."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Target:
    """What the image of one view is compared with."""

    half_a: Float[Array, "receivers 3"]
    half_b: Float[Array, "receivers 3"]
    weight: Float[Array, "receivers 3"]
    """The weight of each value in the sum of squares [1/(W/m²)²]; zero for a black view."""


def relative_weight(mean: Float[np.ndarray, "receivers 3"]) -> Float[np.ndarray, "receivers 3"]:
    """1/(r² + 0.01·mean(r)²) over the number of values: with it, the weighted squared error is relMSE.

    Zero for a view in which no light arrives: it has nothing to say.
    """
    level = mean.mean() ** 2 if mean.size else 0.0
    return 1.0 / (mean**2 + DARK_SHARE * level) / mean.size if level > 0.0 else np.zeros_like(mean)


def target_of(
    half_a: Float32[np.ndarray, "receivers 3"],
    half_b: Float32[np.ndarray, "receivers 3"],
    weight: Float[np.ndarray, "receivers 3"] | None = None,
) -> Target:
    """The target of one view from both halves of its reference at the receivers [W/m²].

    Args:
        weight: of each value; None takes that of relMSE.
    """
    if weight is None:
        weight = relative_weight((half_a.astype(np.float64) + half_b) / 2.0)
    return Target(*(jnp.asarray(values, jnp.float32) for values in (half_a, half_b, weight)))


def weighted_squared_error(image: Float[Array, "receivers 3"], target: Target) -> Float[Array, ""]:
    """Σ weight·(y − a)(y − b): what one step of a fit minimises."""
    return jnp.sum(target.weight * (image - target.half_a) * (image - target.half_b))
