"""An environment cut into compact parts of about equal power.

The parts are made by median cut (Debevec 2005, "A Median Cut Algorithm for Light Probe Sampling"), and then
moved by Lloyd iterations on the sphere, so that each is compact.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from vpltune.renderer.scene.environment import Environment, solid_angles, texel_directions

ROWS = 64
"""Rows of the map that is cut, and half its columns: 2.8° each. A choice: a part of 1/256 of the sky has 32
texels."""
_ITERATIONS = 8
"""Lloyd iterations. A choice: the parts of an even sky then differ in size by less than a tenth."""
_NARROWEST = 0.1
"""Angle in radians between parts that are joined: a sun is one part. A choice, 5.7°; 256 even parts are 13°
apart."""
_BELOW = 0.25
"""What light from below the horizon counts for when the sky is cut: most scenes have a ground that hides it.
A choice: a fifth of the parts of an even sky are there."""


@dataclass(frozen=True, eq=False)
class SkyParts:
    """The lit texels of a sky, and the part that each belongs to."""

    directions: Float64[np.ndarray, "texels 3"]
    """Unit vectors towards the texels."""
    flux: Float64[np.ndarray, "texels 3"]
    """W/m² on a surface square to each."""
    owner: Int64[np.ndarray, " texels"]
    """Each part's number, from 0 to one less than `count`."""

    @property
    def count(self) -> int:
        """How many parts there are."""
        return int(self.owner.max()) + 1 if len(self.owner) else 0

    @property
    def power(self) -> Float64[np.ndarray, " texels"]:
        """The mean of the flux's channels."""
        return self.flux.mean(axis=1)

    def middles(self) -> Float64[np.ndarray, "parts 3"]:
        """Unit vectors to the middle of each part's light."""
        return part_middles(self.directions, self.power, self.owner)


def sky_parts(environment: Environment, count: int) -> SkyParts:
    """At most `count` parts of an environment; fewer where it has fewer lit texels."""
    radiance = _resampled(environment.radiance.astype(np.float64))
    height, width, _ = radiance.shape
    directions = texel_directions(height, width).reshape(-1, 3)
    flux = (radiance * solid_angles(height, width)[:, None, None]).reshape(-1, 3)
    power = flux.mean(axis=1)
    lit = power > 0.0
    directions, flux, power = directions[lit], flux[lit], power[lit]
    if not len(power):
        return SkyParts(directions, flux, np.zeros(0, np.int64))
    owner = median_cut(directions, np.where(directions[:, 1] < 0.0, _BELOW * power, power), count)
    for _ in range(_ITERATIONS):
        middles = part_middles(directions, power, owner)
        owner = np.unique((directions @ middles.T).argmax(axis=1), return_inverse=True)[1]
    owner = _joined(part_middles(directions, power, owner), np.bincount(owner, power))[owner]
    return SkyParts(directions, flux, owner)


def median_cut(
    directions: Float64[np.ndarray, "texels 3"], power: Float64[np.ndarray, " texels"], count: int
) -> Int64[np.ndarray, " texels"]:
    """The part of each texel: that with the most power is halved across its longest side, over and over."""
    owner = np.zeros(len(power), np.int64)
    parts = 1
    can_be_cut = {0}
    while parts < count and can_be_cut:
        sums = np.bincount(owner, power, parts)
        largest = max(sorted(can_be_cut), key=lambda part: sums[part])
        own = np.flatnonzero(owner == largest)
        if len(own) < 2:
            can_be_cut.discard(largest)
            continue
        axis = np.ptp(directions[own], axis=0).argmax()
        own = own[np.argsort(directions[own, axis], kind="stable")]
        running = np.cumsum(power[own])
        first = int(np.clip(np.searchsorted(running, 0.5 * running[-1]) + 1, 1, len(own) - 1))
        owner[own[first:]] = parts
        can_be_cut.add(parts)
        parts += 1
    return owner


def _joined(middles: Float64[np.ndarray, "parts 3"], powers: Float64[np.ndarray, " parts"]) -> np.ndarray:
    """For each part the new number: the cut may have halved a sun, whose parts become one again."""
    kept: list[int] = []
    number = np.zeros(len(powers), np.int64)
    for part in np.argsort(-powers, kind="stable"):
        near = [k for k, other in enumerate(kept) if middles[other] @ middles[part] > np.cos(_NARROWEST)]
        if not near:
            kept.append(int(part))
        number[part] = near[0] if near else len(kept) - 1
    return number


def _resampled(radiance: Float64[np.ndarray, "height width 3"]) -> Float64[np.ndarray, "rows columns 3"]:
    """The map with `ROWS` rows: the means over their solid angle."""
    height, width, _ = radiance.shape
    rows = _overlaps(
        np.cos(np.pi * np.arange(height + 1) / height), np.cos(np.pi * np.arange(ROWS + 1) / ROWS)
    )
    columns = _overlaps(np.arange(width + 1) / width, np.arange(2 * ROWS + 1) / (2 * ROWS))
    return np.einsum("rh,hwc,kw->rkc", rows, radiance, columns, optimize=True)


def _overlaps(edges: np.ndarray, wanted: np.ndarray) -> Float64[np.ndarray, "wanted given"]:
    """The share of each given interval in each wanted one, in parts of the wanted one."""
    low = np.minimum(edges[:-1], edges[1:]), np.minimum(wanted[:-1], wanted[1:])
    high = np.maximum(edges[:-1], edges[1:]), np.maximum(wanted[:-1], wanted[1:])
    common = np.minimum(high[0], high[1][:, None]) - np.maximum(low[0], low[1][:, None])
    return np.maximum(common, 0.0) / (high[1] - low[1])[:, None]


def part_middles(
    directions: Float64[np.ndarray, "texels 3"], power: Float64[np.ndarray, " texels"], owner: np.ndarray
) -> Float64[np.ndarray, "parts 3"]:
    """The unit vector to the middle of each part's light; of one whose vectors cancel, its first texel."""
    parts = int(owner.max()) + 1
    sums = np.stack([np.bincount(owner, power * directions[:, axis], parts) for axis in range(3)], axis=1)
    first = directions[np.unique(owner, return_index=True)[1]]
    total = np.bincount(owner, power, parts)
    length = np.linalg.norm(sums, axis=1)
    return np.where((length > 1e-6 * total)[:, None], sums / np.maximum(length, 1e-300)[:, None], first)
