"""Thousands of small direct lights without shadows: point and spot, each with a range.

Irradiance at distance d on a surface at angle θ is I·cos θ·cone·w(d)/d², with the window
w = max(min(1 − (d/range)⁴, 1), 0) that KHR_lights_punctual recommends under "Range Property", so that a
light reaches no further than `range`. The cone is that of `renderer.scene.scene.Light`.
Twin: shaders/common/dynamic_lights.glsl.
"""

import math

import numpy as np
from jaxtyping import Float64

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
"""One light as the shaders read it (std430). range: world units. intensity: W/sr, linear. cos_outer and
cone_scale = 1/(cos inner − cos outer) make the cone: clamp((cos θ − cos_outer)·cone_scale, 0, 1)²."""

POINT_COS_OUTER = -2.0
"""Below every cosine: with cone_scale 1 the cone of a point light is 1 in all directions."""

MIN_DISTANCE = 2.0**-9
"""In ranges. Nearer than this a light grows no brighter: a half float holds no more (see
`_accumulation_unit`), and only pixels that a light is about to touch are concerned."""

# Half floats keep full precision from 2⁻¹⁴ to 2¹⁶. The light of the largest I/range² gives at most
# I/range²/MIN_DISTANCE² = 2¹⁸·I/range². With its I/range² at 2⁻⁴ four such lights may stand on one point, and
# one 1,000 times as weak still keeps full precision where it gives its own I/range².
_UNIT_IN_STRONGEST = 2.0**4


def point_lights(
    positions_world: Float64[np.ndarray, "n 3"], intensity: np.ndarray, range_world: np.ndarray | float
) -> np.ndarray:
    """Records of point lights; `intensity` [W/sr] is [n, 3] or [3], `range_world` [n] or one number."""
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
    """Records of spot lights; directions are unit vectors along the light.

    Raises:
        ValueError: not 0 ≤ inner < outer ≤ π/2 (half angles, radians).
    """
    if not 0.0 <= inner_cone < outer_cone <= math.pi / 2:
        raise ValueError(f"spot_lights: 0 ≤ inner < outer ≤ π/2 must hold, got {inner_cone} and {outer_cone}")
    records = point_lights(positions_world, intensity, range_world)
    records["direction_world"] = directions_world
    records["cos_outer"] = math.cos(outer_cone)
    records["cone_scale"] = 1.0 / max(math.cos(inner_cone) - math.cos(outer_cone), 1e-6)
    return records


def scaled_records(records: np.ndarray, factor: float) -> np.ndarray:
    """The lights of a scene `factor` times as large: the same irradiance at the corresponding points."""
    grown = records.copy()
    grown["position_world"] *= np.float32(factor)
    grown["range"] *= np.float32(factor)
    grown["intensity"] *= np.float32(factor**2)
    return grown


class DynamicLights:
    """What shines this frame. Give new records to `update` before a frame; the runtime uploads them.

    Example:
        >>> lights = DynamicLights(point_lights(positions, np.full(3, 0.1), 0.5))
        >>> runtime.render(view, lights=lights)
    """

    def __init__(self, records: np.ndarray):
        self.update(records)

    def update(self, records: np.ndarray) -> None:
        """Take `records` [n] of `DYNAMIC_LIGHT_DTYPE`, which are kept, not copied, if points come first.

        Raises:
            ValueError: another dtype or shape, a range that is not positive, an intensity that is negative,
                or a number that is not finite.
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
            raise ValueError(f"DynamicLights: no intensity may be negative, got {numbers[:, 4:7].min()}")
        is_point = numbers[:, 7] < -1.0
        self.point_count = int(np.count_nonzero(is_point))
        if not is_point[: self.point_count].all():
            numbers = numbers[np.argsort(~is_point, kind="stable")]
        self.numbers = numbers
        self.accumulation_unit = _accumulation_unit(numbers)

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def spot_count(self) -> int:
        """Spots follow the points."""
        return len(self.numbers) - self.point_count


def _accumulation_unit(numbers: np.ndarray) -> float:
    """Irradiance [W/m²] that the half-float accumulation buffer holds as 1.

    It comes from the lights alone and is a power of two: nothing is measured or rounded, and lights and scene
    scaled together leave every stored number as it is.
    """
    if not len(numbers):
        return 1.0
    strongest = float((numbers[:, 4:7].max(axis=1) / np.square(numbers[:, 3])).max())
    if not (math.isfinite(strongest) and strongest > 0.0):
        return 1.0
    return 2.0 ** math.ceil(math.log2(strongest)) * _UNIT_IN_STRONGEST
