"""A clustered disc light, clipped at the receiver's horizon. Twin: shaders/common/vpl_disc.glsl.

That file has the equation and its source. Every root and quotient is clamped so that its derivative is
finite, even where `where` discards the result.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from vpltune.renderer.frame.vpl_disc_bounds import FACING_FADE_HEIGHT, FADE_HEIGHT, LEAST_PART


def disc_past_chord(t: Float[Array, "*n"]) -> tuple[Float[Array, "*n"], Float[Array, "*n"]]:
    """Area share and centroid of a unit disc's segment. Twin: `disc_past_chord` in GLSL.

    Args:
        t: Signed distance from the disc's centre to the chord; positive if the segment contains the centre.

    Returns:
        Share of the disc's area in the segment, in [0, 1]; distance of its centroid from the disc's centre.
    """
    a = jnp.minimum(jnp.abs(t), 1.0 - 1e-6)
    root = jnp.sqrt(1.0 - a)
    half_chord = root * jnp.sqrt(1.0 + a)
    angle = root * (1.5707288 + a * (-0.2121144 + a * (0.0742610 - a * 0.0187293)))
    lesser = jnp.maximum(angle - a * half_chord, 0.0) / np.pi
    share = jnp.where(t > 0.0, 1.0 - lesser, lesser)
    moment = 2.0 / (3.0 * np.pi) * half_chord**3
    return share, moment / jnp.maximum(share, LEAST_PART)


def disc_axial(
    distance_squared: Float[Array, "*n"], height: Float[Array, "*n"], radius_squared: Float[Array, "*m"]
) -> tuple[Float[Array, "*n"], Float[Array, "*n"]]:
    """Q and the axial term h²/(Q + S − 2l²) of a disc. Twin: `disc_axial` in GLSL.

    Args:
        distance_squared: Squared distance of the receiver from the disc's centre.
        height: Height of the receiver above the disc's plane, at least 0.
        radius_squared: Squared radius of the disc.
    """
    excess = distance_squared - radius_squared
    q = jnp.sqrt(jnp.maximum(excess**2 + 4.0 * height**2 * radius_squared, 1e-36))
    larger = q + jnp.abs(excess)
    return q, jnp.where(excess > 0.0, height**2 / larger, larger / (4.0 * radius_squared))


def disc_form(
    squared: Float[Array, "*n"],
    facing: Float[Array, "*n"],
    height: Float[Array, "*n"],
    between: Float[Array, "*n"],
    radius: Float[Array, "*m"],
) -> Float[Array, "*n"]:
    """Irradiance from a disc light in units of Φ/π, ≥ 0. Twin: `disc_vector` in GLSL, dotted with the normal.

    All lengths are in units of L. c is the disc's centre and m its normal, x the receiver and n its normal.

    Args:
        squared: |c − x|².
        facing: Height of c above the receiver's horizon, n·(c − x).
        height: Height of x above the disc's plane, m·(x − c).
        between: Cosine of the angle between the normals, n·m.
        radius: Radius of the disc, at least `LEAST_RADIUS`.
    """
    slope = jnp.sqrt(jnp.maximum(1.0 - between**2, 1e-12))
    above = facing / (slope * radius)
    share, offset = disc_past_chord(above)
    fade_height = (FADE_HEIGHT + FACING_FADE_HEIGHT * jnp.maximum(-between, 0.0) ** 2) * radius
    fade = jnp.minimum(2.0 * height / fade_height - 1.0, 1.0)
    lit = (fade > 0.0) & (share >= LEAST_PART)
    height = jnp.maximum(height, 0.0)
    share = jnp.maximum(share, LEAST_PART)
    # Move the centre to the centroid of the visible part: by `shift` in the disc's plane, away from the
    # horizon.
    shift = offset * radius
    distance_squared = squared + 2.0 * shift * (facing + between * height) / slope + shift**2
    radius_squared = radius**2 * share
    q, axial = disc_axial(distance_squared, height, radius_squared)
    lateral = height / (q + distance_squared + radius_squared)
    received = (facing + shift * slope + height * between) * lateral - between * axial
    uncut_q, uncut_axial = disc_axial(squared, height, radius**2)
    facing_form = 2.0 * radius**2 * uncut_axial / uncut_q
    least = jnp.clip(2.0 * above, 0.0, 1.0) * 0.5 * (1.0 - between) * facing_form**4 / radius**2
    return jnp.where(lit, jnp.maximum(received * (2.0 * share / q), least) * fade, 0.0)
