"""Random directions and points about an axis, from two numbers in [0, 1)."""

import math


def cosine_direction(wavefront, normal, u, v):
    """Density cos θ/π about a unit normal."""
    return _about(wavefront, normal, wavefront.sqrt(1.0 - u), wavefront.sqrt(u), v)


def cone_direction(wavefront, axis, least_cosine, u, v):
    """Uniform over the solid angle where cos θ ≥ `least_cosine`, 2π(1 − least_cosine) steradians."""
    w = wavefront
    # 1 − cos θ, not cos θ, is what stays exact in a narrow cone.
    drop = u * (1.0 - least_cosine)
    return _about(w, axis, 1.0 - drop, w.sqrt(drop * (2.0 - drop)), v)


def disc_point(wavefront, axis, u, v):
    """Uniform over the unit disc across a unit axis."""
    return _about(wavefront, axis, 0.0, wavefront.sqrt(u), v)


def _about(wavefront, axis, along, across, turn):
    """`along` the axis and `across` it, `turn` of the way round.

    Basis: Duff et al. (2017), "Building an Orthonormal Basis, Revisited", listing 3.
    """
    w = wavefront
    x, y = across * w.cos(turn * (2.0 * math.pi)), across * w.sin(turn * (2.0 * math.pi))
    sign = w.where(axis[2] < 0.0, -1.0, 1.0)
    a = -1.0 / (sign + axis[2])
    b = axis[0] * axis[1] * a
    tangent = w.vector(1.0 + sign * axis[0] * axis[0] * a, sign * b, -sign * axis[0])
    bitangent = w.vector(b, sign + axis[1] * axis[1] * a, -axis[1])
    return tangent * x + bitangent * y + axis * along
