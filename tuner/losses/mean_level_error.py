"""Relative squared error of a view's mean irradiance, without fitting the reference's noise.

    (mean(y) − mean(a)) (mean(y) − mean(b)) / mean(r)²

Relative error alone answers light that leaks into dark corners by dimming everything, since a dark pixel
weighs more than a bright one; how bright the whole picture is, is what an eye sees first.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from tuner.losses.relative_squared_error import Target


def mean_level_error(picture: Float[Array, "receivers 3"], target: Target) -> Float[Array, ""]:
    """Squared relative error of the mean over receivers and channels; zero for a black reference."""
    mean_a, mean_b = jnp.mean(target.half_a), jnp.mean(target.half_b)
    level = ((mean_a + mean_b) / 2.0) ** 2
    error = (jnp.mean(picture) - mean_a) * (jnp.mean(picture) - mean_b)
    # Both branches are evaluated for the gradient: the quotient must be finite where it is not used.
    return jnp.where(level > 0.0, error / jnp.where(level > 0.0, level, 1.0), 0.0)
