"""Dynamic lights: thousands of small point and spot lights with a finite range and without shadows.

Irradiance at distance d on a surface at angle θ is I·cos θ·cone·w(d)/d². The window
w = max(min(1 − (d/range)⁴, 1), 0) is the one that KHR_lights_punctual recommends under "Range Property"; it
ends the light at `range`. The cone factor is that of `renderer.scene.scene.Light`.
Twin: shaders/common/dynamic_lights.glsl.
"""

import math

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.spot_cone import checked_cone, cone_scale

DYNAMIC_LIGHT_DTYPE = np.dtype(
    [
        ("position_world", "f4", 3),
        ("range", "f4"),
        ("intensity", "f4", 3),
        ("cos_outer", "f4"),
        ("direction_world", "f4", 3),
        ("cone_scale", "f4"),
    ]
)
"""One light in the layout of the shaders (std430). `range` is in world units, `intensity` in linear W/sr.

With cone_scale = 1/(cos inner − cos outer), the cone factor is clamp((cos θ − cos_outer)·cone_scale, 0, 1)².
"""

POINT_COS_OUTER = -2.0
"""Less than any cosine, so with a cone_scale of 1 a point light's cone factor is 1 in all directions."""

MIN_DISTANCE = 2.0**-9
"""Smallest distance used for the 1/d² falloff, in units of the light's range.

It bounds irradiance to what a half float holds (see `_UNIT_IN_STRONGEST`). Only pixels that a light almost
touches are affected.
"""

# The accumulation unit, in units of the largest I/range² of all lights. Half floats have full precision from
# 2⁻¹⁴ to 2¹⁶. The strongest light gives at most I/range²/MIN_DISTANCE² = 2¹⁸·I/range². Storing its I/range²
# as 2⁻⁴ leaves room for four such lights at one point, and a light 1,000 times weaker still has full
# precision where it gives its own I/range².
_UNIT_IN_STRONGEST = 2.0**4


def point_lights(
    positions_world: Float64[np.ndarray, "n 3"], intensity: np.ndarray, range_world: np.ndarray | float
) -> np.ndarray:
    """Records of point lights, [n] of `DYNAMIC_LIGHT_DTYPE`.

    Args:
        positions_world: world units.
        intensity: W/sr, linear, of shape [n, 3] or [3].
        range_world: world units, of shape [n] or one number.
    """
    records = np.zeros(len(positions_world), DYNAMIC_LIGHT_DTYPE)
    records["position_world"] = positions_world
    records["intensity"] = intensity
    records["range"] = range_world
    records["direction_world"] = (0.0, 0.0, -1.0)
    records["cos_outer"] = POINT_COS_OUTER
    records["cone_scale"] = 1.0
    return records


def spot_lights(
    positions_world: Float64[np.ndarray, "n 3"],
    intensity: np.ndarray,
    range_world: np.ndarray | float,
    directions_world: Float64[np.ndarray, "n 3"],
    inner_cone: float,
    outer_cone: float,
) -> np.ndarray:
    """Records of spot lights, [n] of `DYNAMIC_LIGHT_DTYPE`.

    Args:
        positions_world: world units.
        intensity: W/sr, linear, of shape [n, 3] or [3].
        range_world: world units, of shape [n] or one number.
        directions_world: unit vectors in which the light travels.
        inner_cone: half angle in radians; equal to `outer_cone` for a hard edge.
        outer_cone: half angle in radians.

    Raises:
        InputError: 0 ≤ inner_cone ≤ outer_cone ≤ π/2 does not hold, or outer_cone is 0.
    """
    inner_cone, outer_cone = checked_cone(inner_cone, outer_cone, "radians", "spot_lights")
    records = point_lights(positions_world, intensity, range_world)
    records["direction_world"] = directions_world
    records["cos_outer"] = math.cos(outer_cone)
    records["cone_scale"] = cone_scale(inner_cone, outer_cone)
    return records


def scaled_records(records: np.ndarray, factor: float) -> np.ndarray:
    """The records for a scene scaled by `factor`: they give corresponding points the same irradiance."""
    grown = records.copy()
    grown["position_world"] *= np.float32(factor)
    grown["range"] *= np.float32(factor)
    grown["intensity"] *= np.float32(factor**2)
    return grown


class DynamicLights:
    """The dynamic lights of a frame. Call `update` with new records before a frame; the runtime uploads them.

    Example:
        >>> lights = DynamicLights(point_lights(positions, np.full(3, 0.1), 0.5))
        >>> runtime.render(view, lights=lights)
    """

    def __init__(self, records: np.ndarray):
        self.update(records)

    def update(self, records: np.ndarray) -> None:
        """Replace the lights by `records`, [n] of `DYNAMIC_LIGHT_DTYPE`.

        Point lights are sorted before spots. Records already in that order are kept without a copy.

        Raises:
            ValueError: the dtype or shape is wrong, a range is not positive, an intensity is negative, or a
                number is not finite.
        """
        if records.dtype != DYNAMIC_LIGHT_DTYPE or records.ndim != 1:
            raise ValueError(
                "DynamicLights: records must be [n] of DYNAMIC_LIGHT_DTYPE,"
                f" got {records.shape} {records.dtype}"
            )
        numbers = np.ascontiguousarray(records).view(np.float32).reshape(-1, 12)
        if not np.isfinite(numbers).all():
            raise ValueError("DynamicLights: every number must be finite")
        if not (numbers[:, 3] > 0.0).all():
            raise ValueError(f"DynamicLights: every range must be positive, got {numbers[:, 3].min()}")
        if not (numbers[:, 4:7] >= 0.0).all():
            raise ValueError(f"DynamicLights: every intensity must be ≥ 0, got {numbers[:, 4:7].min()}")
        is_point = numbers[:, 7] < -1.0
        self.point_count = int(np.count_nonzero(is_point))
        if not is_point[: self.point_count].all():
            numbers = numbers[np.argsort(~is_point, kind="stable")]
        self.numbers = numbers
        self.accumulation_unit = _accumulation_unit(numbers)

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def records(self) -> np.ndarray:
        """The lights as [n] of `DYNAMIC_LIGHT_DTYPE`, point lights first."""
        return np.ascontiguousarray(self.numbers).view(DYNAMIC_LIGHT_DTYPE).reshape(-1)

    @property
    def spot_count(self) -> int:
        """Number of spot lights. They follow the point lights."""
        return len(self.numbers) - self.point_count


def _accumulation_unit(numbers: np.ndarray) -> float:
    """Irradiance in W/m² that the half-float accumulation buffer stores as 1.

    It is a power of two, so scaling by it does not round. It depends on the lights alone, and on them only
    through I/range², so the stored numbers do not change if lights and scene are scaled together.
    """
    if not len(numbers):
        return 1.0
    strongest = float((numbers[:, 4:7].max(axis=1) / np.square(numbers[:, 3])).max())
    if not (math.isfinite(strongest) and strongest > 0.0):
        return 1.0
    return 2.0 ** math.ceil(math.log2(strongest)) * _UNIT_IN_STRONGEST
