"""Weighted squared error against a noisy reference, without fitting its noise.

    relMSE(y, r) = mean((y − r)² / (r² + 0.01·mean(r)²))

over valid pixels and channels. The reference r = (a + b)/2 is the mean of two independent halves. (y − r)²
contains the noise of r. (y − a)(y − b) has the same expectation without that noise, because the product of
the noise of a and the noise of b has mean zero.

A fit does not minimise relMSE itself, which a few pixels can dominate. It reweights the pixels for robustness
(`tuner.metrics.robust_error`).
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

DARK_SHARE = 0.01
"""Share of mean(r)² that is added to r², so that black pixels have a finite weight. A choice."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Target:
    """The reference of one view and the weights of its values."""

    half_a: Float[Array, "receivers 3"]
    """One half of the reference [W/m²]."""
    half_b: Float[Array, "receivers 3"]
    """The other half, with independent noise [W/m²]."""
    weight: Float[Array, "receivers 3"]
    """Weight of each value in the sum of squares [1/(W/m²)²]; zero for a black view."""


def relative_weight(mean: Float[np.ndarray, "receivers 3"]) -> Float[np.ndarray, "receivers 3"]:
    """1/(r² + 0.01·mean(r)²) ÷ number of values [1/(W/m²)²]: the weights of relMSE. Zero for a black view."""
    level = mean.mean() ** 2 if mean.size else 0.0
    return 1.0 / (mean**2 + DARK_SHARE * level) / mean.size if level > 0.0 else np.zeros_like(mean)


def target_of(
    half_a: Float32[np.ndarray, "receivers 3"],
    half_b: Float32[np.ndarray, "receivers 3"],
    weight: Float[np.ndarray, "receivers 3"] | None = None,
) -> Target:
    """The target of one view.

    Args:
        half_a: One half of the reference at the receivers [W/m²].
        half_b: The other half [W/m²].
        weight: Weight of each value [1/(W/m²)²]; None for the weights of relMSE.
    """
    if weight is None:
        weight = relative_weight((half_a.astype(np.float64) + half_b) / 2.0)
    return Target(*(jnp.asarray(values, jnp.float32) for values in (half_a, half_b, weight)))


def weighted_squared_error(image: Float[Array, "receivers 3"], target: Target) -> Float[Array, ""]:
    """Σ weight·(y − a)(y − b), which each step of a fit minimises. May be negative because of noise."""
    return jnp.sum(target.weight * (image - target.half_a) * (image - target.half_b))
