"""Sampling directions and points about an axis, each from two numbers in [0, 1).

Axes and results are one vector per lane of the wavefront, of unit length unless stated otherwise.
"""

import math


def cosine_direction(wavefront, normal, u, v):
    """A direction with density cos θ/π per steradian about a unit normal."""
    return _about(wavefront, normal, wavefront.sqrt(1.0 - u), wavefront.sqrt(u), v)


def cone_direction(wavefront, axis, least_cosine, u, v):
    """A direction uniform over the cone cos θ ≥ `least_cosine`, of 2π(1 − least_cosine) steradians."""
    w = wavefront
    # Work with 1 − cos θ: in a narrow cone cos θ itself would lose its digits to rounding.
    drop = u * (1.0 - least_cosine)
    return _about(w, axis, 1.0 - drop, w.sqrt(drop * (2.0 - drop)), v)


def disc_point(wavefront, axis, u, v):
    """A point uniform over the unit disc that is centred at the origin and perpendicular to a unit axis."""
    return _about(wavefront, axis, 0.0, wavefront.sqrt(u), v)


def _about(wavefront, axis, along, across, turn):
    """The vector with cylindrical coordinates about `axis`: height `along`, radius `across`, angle 2π·`turn`.

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
