"""The half angles of a spot's cone."""

import math
from typing import Literal

from vpltune.renderer.errors import InputError

# A choice: a hard edge is drawn as a falloff over the last thousandth of the half angle. That takes 0.13 % of
# the flux, and the difference of the cosines still fits single precision.
_HARD_EDGE = 0.999


def softened(inner_cone: float, outer_cone: float) -> tuple[float, float]:
    """The half angles as they are drawn: where both are the same, the inner one is a thousandth smaller."""
    return min(inner_cone, _HARD_EDGE * outer_cone), outer_cone


def checked_cone(
    inner_cone: float, outer_cone: float, unit: Literal["radians", "degrees"], where: str
) -> tuple[float, float]:
    """The half angles of a spot in radians, checked against the rule of KHR_lights_punctual.

    Both may be the same, which is a hard edge.

    Args:
        inner_cone: half angle where the light begins to fall off, in `unit`.
        outer_cone: half angle where it ends; 1e-6 radians above π/2 are the rounding of single precision.
        unit: of both angles.
        where: file and key, for the message.

    Raises:
        InputError: 0 ≤ inner_cone ≤ outer_cone ≤ 90° does not hold, or outer_cone is 0.
    """
    factor = 1.0 if unit == "radians" else math.pi / 180.0
    inner, outer = factor * inner_cone, factor * outer_cone
    if not (0.0 <= inner <= outer <= math.pi / 2.0 + 1e-6 and outer > 0.0):
        right = "π/2" if unit == "radians" else "90"
        raise InputError(
            f"{where}: cone angles must satisfy 0 ≤ inner ≤ outer ≤ {right} {unit} and outer > 0, "
            f"got {inner_cone:g} and {outer_cone:g}"
        )
    return softened(inner, outer)
