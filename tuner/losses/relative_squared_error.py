"""Relative squared error against a noisy reference, without fitting its noise.

    relMSE(y, r) = mean((y − r)² / (r² + 0.01·mean(r)²))

over valid pixels and channels. With r = (a + b)/2 from two independent halves, (y − r)² holds the noise of
r as well; (y − a)(y − b) has the same expectation without it, since the noise of a and of b multiply to
zero in the mean (the two-half estimator of Rousselle, Knaus and Zwicker 2012, section 4, used as a loss).
"""

import jax
import jax.numpy as jnp
import numpy as np
from dataclasses import dataclass
from jaxtyping import Array, Float, Float32

DARK_SHARE = 0.01
"""Of the squared mean, added to r²: a black pixel must not weigh infinitely."""


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class Target:
    """What a picture of many views is compared with; views share the receivers' axis."""

    half_a: Float[Array, "receivers 3"]
    half_b: Float[Array, "receivers 3"]
    weight: Float[Array, "receivers 3"]
    """1/(r² + 0.01·mean(r)²), divided by the view's number of values and by the number of views."""


def target_of(
    halves: list[tuple[Float32[np.ndarray, "receivers 3"], Float32[np.ndarray, "receivers 3"]]],
) -> Target:
    """The target of several views, each counting the same.

    Args:
        halves: both halves of each view at the receivers, [receivers, 3] in W/m². A view in which no
            light arrives has nothing to say, and gets weight zero.
    """
    weights = []
    for a, b in halves:
        mean = (a.astype(np.float64) + b) / 2.0
        level = DARK_SHARE * mean.mean() ** 2 if mean.size else 0.0
        weight = np.zeros_like(mean) if level == 0.0 else 1.0 / (mean**2 + level)
        weights.append(weight / max(1, mean.size) / len(halves))
    return Target(
        half_a=jnp.asarray(np.concatenate([a for a, _ in halves]), jnp.float32),
        half_b=jnp.asarray(np.concatenate([b for _, b in halves]), jnp.float32),
        weight=jnp.asarray(np.concatenate(weights), jnp.float32),
    )


def relative_squared_error(picture: Float[Array, "receivers 3"], target: Target) -> Float[Array, ""]:
    """Sum of weight·(y − a)(y − b): relMSE less the noise floor, the mean over views."""
    return jnp.sum(target.weight * (picture - target.half_a) * (picture - target.half_b))
