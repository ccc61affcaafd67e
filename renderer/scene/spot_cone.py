"""The half angles of a spot's cone: the one rule of what is allowed, and what is drawn."""

import math
from typing import Literal

from vpltune.renderer.errors import InputError

# A choice: a hard edge is drawn as a falloff over the last thousandth of the half angle, which takes 0.13 %
# of the flux. Below 1.8°, `LEAST_COSINES` is more than that, and the falloff takes a larger part of the cone.
_HARD_EDGE = 0.999
# π/2 in single precision exceeds π/2 by 4e-8; this accepts it, and degrees rounded to four digits.
_ROUNDING = 1e-6
LEAST_COSINES = 1e-6
"""Least difference of the cosines of a cone's half angles. A cosine near 1 has steps of 6e-8 in single
precision, so the falloff has at least some sixteen steps."""


def cone_scale(inner_cone: float, outer_cone: float) -> float:
    """1 / (cos inner − cos outer), by which the falloff of KHR_lights_punctual is drawn; at most 1e6.

    Args:
        inner_cone: half angle in radians.
        outer_cone: half angle in radians, at least `inner_cone`.
    """
    return 1.0 / max(math.cos(inner_cone) - math.cos(outer_cone), LEAST_COSINES)


def checked_cone(
    inner_cone: float,
    outer_cone: float,
    unit: Literal["radians", "degrees"],
    where: str,
    names: tuple[str, str] = ("inner", "outer"),
    widest_degrees: float = 90.0,
    error: type[ValueError] = InputError,
) -> tuple[float, float]:
    """The half angles of a spot as they are drawn, in radians: at most π/2, and the inner one less.

    Equal angles are a hard edge. KHR_lights_punctual does not allow them, but Blender writes them for a spot
    without blend.

    Args:
        inner_cone: half angle where the light begins to fall off, in `unit`.
        outer_cone: half angle where it ends; 1e-6 radians too much are the rounding of single precision.
        unit: of both angles.
        where: file and key, for the message.
        names: of both angles, for the message.
        widest_degrees: largest angle that is allowed. What is wider than 90° ends there.
        error: what is raised; inside a reader of scenes, its own kind.

    Raises:
        InputError: 0 ≤ inner_cone ≤ outer_cone ≤ widest_degrees does not hold, or outer_cone is 0.
    """
    factor = 1.0 if unit == "radians" else math.pi / 180.0
    inner, outer = factor * inner_cone, factor * outer_cone
    if not (0.0 <= inner <= outer <= math.radians(widest_degrees) + _ROUNDING and outer > 0.0):
        first, second = names
        right = "π/2" if unit == "radians" else f"{widest_degrees:g}"
        raise error(
            f"{where}: cone angles must satisfy 0 ≤ {first} ≤ {second} ≤ {right} {unit} and {second} > 0, "
            f"got {inner_cone:g} and {outer_cone:g}"
        )
    outer = min(outer, math.pi / 2.0)
    return min(inner, _HARD_EDGE * outer), outer
