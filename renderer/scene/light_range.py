"""The range of a point or spot light: where its light ends, and how it is drawn."""

import numpy as np

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files.limits import SMALLEST_RANGE
from vpltune.renderer.scene.scene import Light

LARGEST_INVERSE = 1e18
"""Largest `inverse_range`. A choice: float32 holds its square."""


def inverse_range(light: Light, unit: float = 1.0) -> float:
    """1 / range; 0 where the light does not end, as a directional light never does.

    Args:
        light: its range is in world units.
        unit: what the inverse is to be measured in, in world units.
    """
    return 0.0 if light.kind == "directional" else min(unit / light.range, LARGEST_INVERSE)


def range_falloff(light: Light, distance: np.ndarray) -> np.ndarray:
    """Share of the light that is left at a distance: max(1 − (d/range)⁴, 0), and 1 without a range.

    KHR_lights_punctual, "Range Property". Twin: `range_falloff` of shaders/common/lights.glsl.

    Args:
        light: its range is in world units.
        distance: from the light, world units.
    """
    return np.maximum(1.0 - (distance * inverse_range(light)) ** 4, 0.0)


def checked_range(value: float, where: str) -> float:
    """A range in world units as a file has it; `where` names file and key in the message.

    Raises:
        InputError: it is less than `SMALLEST_RANGE`.
    """
    if not value >= SMALLEST_RANGE:
        raise InputError(f"{where}: must be positive, at least {SMALLEST_RANGE:g}, got {value:g}")
    return value
