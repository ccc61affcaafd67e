"""Relative squared error against a noisy reference, without fitting its noise.

    relMSE(y, r) = mean((y − r)² / (r² + 0.01·mean(r)²))

over valid pixels and channels. With r = (a + b)/2 from two independent halves, (y − r)² holds the noise of
r as well; (y − a)(y − b) has the same expectation without it, since the noise of a and of b multiply to
zero in the mean (the two-half estimator of Rousselle, Knaus and Zwicker 2012, section 4, used as a loss).
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

DARK_SHARE = 0.01
"""Of the squared mean, added to r²: a black pixel must not weigh infinitely."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Target:
    """What the picture of one view is compared with."""

    half_a: Float[Array, "receivers 3"]
    half_b: Float[Array, "receivers 3"]
    weight: Float[Array, "receivers 3"]
    """1/(r² + 0.01·mean(r)²), divided by the number of values; zero where the whole view is black."""


def target_of(
    half_a: Float32[np.ndarray, "receivers 3"], half_b: Float32[np.ndarray, "receivers 3"]
) -> Target:
    """The target of one view from both halves of its reference at the receivers, W/m².

    A view in which no light arrives has nothing to say, and gets weight zero.
    """
    mean = (half_a.astype(np.float64) + half_b) / 2.0
    level = DARK_SHARE * mean.mean() ** 2 if mean.size else 0.0
    weight = np.zeros_like(mean) if level == 0.0 else 1.0 / (mean**2 + level) / mean.size
    return Target(*(jnp.asarray(values, jnp.float32) for values in (half_a, half_b, weight)))


def relative_squared_error(picture: Float[Array, "receivers 3"], target: Target) -> Float[Array, ""]:
    """mean((y − a)(y − b)/(r² + 0.01·mean(r)²)): relMSE less the noise floor."""
    return jnp.sum(target.weight * (picture - target.half_a) * (picture - target.half_b))
