"""A cell of light as a disc, cut off at the receiver's horizon: the twin of shaders/common/vpl_disc.glsl.

The equation and its source stand there. Every root and quotient is bounded away from what has no finite
derivative, also where its result is not taken.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from vpltune.renderer.frame.vpl_disc_bounds import FADE_HEIGHT, LEAST_PART


def disc_past_chord(t: Float[Array, "*n"]) -> tuple[Float[Array, "*n"], Float[Array, "*n"]]:
    """Share of a unit disc past a chord, and how far its centroid is from the middle. Twin in GLSL."""
    a = jnp.minimum(jnp.abs(t), 1.0 - 1e-6)
    root = jnp.sqrt(1.0 - a)
    half_chord = root * jnp.sqrt(1.0 + a)
    angle = root * (1.5707288 + a * (-0.2121144 + a * (0.0742610 - a * 0.0187293)))
    lesser = jnp.maximum(angle - a * half_chord, 0.0) / np.pi
    share = jnp.where(t > 0.0, 1.0 - lesser, lesser)
    moment = 2.0 / (3.0 * np.pi) * half_chord**3
    return share, moment / jnp.maximum(share, LEAST_PART)


def disc_form(
    squared: Float[Array, "*n"],
    facing: Float[Array, "*n"],
    height: Float[Array, "*n"],
    between: Float[Array, "*n"],
    radius: Float[Array, "*m"],
) -> Float[Array, "*n"]:
    """Irradiance in units of Φ/π: `disc_vector` of GLSL times the receiver's normal, where that is positive.

    Args:
        squared: of the distance from the receiver to the disc's middle.
        facing: height of the middle over the receiver's horizon, n·(c − x).
        height: of the receiver over the disc's plane, m·(x − c).
        between: cosine of the angle between the normals.
        radius: at least 1e-6; all lengths in units of L.
    """
    slope = jnp.sqrt(jnp.maximum(1.0 - between**2, 1e-12))
    share, offset = disc_past_chord(facing / (slope * radius))
    fade = jnp.minimum(2.0 * height / FADE_HEIGHT - 1.0, 1.0)
    lit = (fade > 0.0) & (share >= LEAST_PART)
    height = jnp.maximum(height, 0.0)
    share = jnp.maximum(share, LEAST_PART)
    # The middle moves by `shift` along the disc's plane, straight up from the receiver's horizon.
    shift = offset * radius
    distance_squared = squared + 2.0 * shift * (facing + between * height) / slope + shift**2
    radius_squared = radius**2 * share
    excess = distance_squared - radius_squared
    q = jnp.sqrt(jnp.maximum(excess**2 + 4.0 * height**2 * radius_squared, 1e-36))
    larger = q + jnp.abs(excess)
    axial = jnp.where(excess > 0.0, height**2 / larger, larger / (4.0 * radius_squared))
    lateral = height / (q + distance_squared + radius_squared)
    received = (facing + shift * slope + height * between) * lateral - between * axial
    return jnp.where(lit, jnp.maximum(received, 0.0) * (2.0 * fade * share / q), 0.0)
