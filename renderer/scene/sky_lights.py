"""An environment as a few directional lights, each for the light of one part of the sky.

The parts are made by median cut (Debevec 2005, "A Median Cut Algorithm for Light Probe Sampling"), and then
moved by Lloyd iterations on the sphere, so that each is compact. A light has the irradiance of its part, from
the middle of the part's light. Parts that a surface sees half of would make an error of some percent; so all
lights are weighted a little, to give surfaces of every orientation the irradiance of the sky itself.
"""

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.environment import Environment, solid_angles, texel_directions
from vpltune.renderer.scene.scene import Light

ROWS = 64
"""Rows of the map that is cut, and half its columns: 2.8° each. A choice: a part of 1/256 of the sky has 32
texels."""
_ITERATIONS = 8
"""Lloyd iterations. A choice: the parts of an even sky then differ in size by less than a tenth."""

_NARROWEST = 0.1
"""Angle in radians between parts that are joined: a sun is one light. A choice, 5.7°; 256 even parts are 13°
apart."""
_BELOW = 0.25
"""What light from below the horizon counts for when the sky is cut: most scenes have a ground that hides it.
A choice: a fifth of the lights of an even sky are there."""
_AXES_COUNT = 30.0
"""How much more surfaces along the six axes count, as most floors and walls are. A choice."""
_ORIENTATIONS = 400
"""Orientations of surfaces whose irradiance is put right. A choice: 10° apart."""
_RIDGE = 1e-3
"""Weight of a factor's change beside the relative squared error. A choice: changes of some percent."""
_MOST_CHANGE = 0.3
"""Largest change of a factor. A choice."""


def sky_lights(environment: Environment, count: int) -> tuple[Light, ...]:
    """At most `count` directional lights that stand for the environment; fewer where it has fewer lit texels.

    Intensities are W/m² on a surface square to the light.
    """
    radiance = _resampled(environment.radiance.astype(np.float64))
    height, width, _ = radiance.shape
    directions = texel_directions(height, width).reshape(-1, 3)
    flux = (radiance * solid_angles(height, width)[:, None, None]).reshape(-1, 3)
    power = flux.mean(axis=1)
    lit = power > 0.0
    directions, flux, power = directions[lit], flux[lit], power[lit]
    if not len(power):
        return ()
    owner = _median_cut(directions, np.where(directions[:, 1] < 0.0, _BELOW * power, power), count)
    for _ in range(_ITERATIONS):
        middles = _middles(directions, power, owner)
        owner = np.unique((directions @ middles.T).argmax(axis=1), return_inverse=True)[1]
    owner = _joined(_middles(directions, power, owner), np.bincount(owner, power))[owner]
    middles = _middles(directions, power, owner)
    weights = _weights(directions, power, middles, np.bincount(owner, power))
    return tuple(
        Light("directional", weight * flux[owner == i].sum(axis=0), direction_world=-middle, name="sky")
        for i, (weight, middle) in enumerate(zip(weights, middles, strict=True))
    )


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


def _weights(
    directions: Float64[np.ndarray, "texels 3"],
    power: Float64[np.ndarray, " texels"],
    middles: Float64[np.ndarray, "parts 3"],
    powers: Float64[np.ndarray, " parts"],
) -> Float64[np.ndarray, " parts"]:
    """Factors of the lights' power, by least squares over the irradiance of surfaces of many orientations.

    Ridge regression (Hoerl and Kennard 1970) towards 1.
    """
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    normals = np.concatenate([_even_directions(_ORIENTATIONS), axes])
    # A floor beside a wall, and a wall over a floor: along one axis, with half of what they see hidden.
    beside = [(normal, half) for normal in axes for half in axes if not normal @ half]
    counts = np.ones(len(normals) + len(beside))
    counts[_ORIENTATIONS:] = _AXES_COUNT

    def seen(towards: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "surfaces n"]:
        open_ones = np.maximum(normals @ towards.T, 0.0)
        hidden = [np.maximum(towards @ normal, 0.0) * (towards @ half > 0.0) for normal, half in beside]
        return np.concatenate([open_ones, np.stack(hidden)])

    wanted = seen(directions) @ power
    given = seen(middles) * powers
    scale = max(wanted.mean(), 1e-300)
    matrix, missing = given / scale, (wanted - given.sum(axis=1)) / scale
    weighted = matrix.T * (counts / counts.sum())
    change = np.linalg.solve(weighted @ matrix + _RIDGE * np.eye(len(middles)), weighted @ missing)
    return 1.0 + np.clip(change, -_MOST_CHANGE, _MOST_CHANGE)


def _even_directions(count: int) -> Float64[np.ndarray, "count 3"]:
    """Unit vectors spread evenly: a spherical Fibonacci lattice (González 2010)."""
    y = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - y * y)
    return np.stack([radius * np.cos(angle), y, radius * np.sin(angle)], axis=1)


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


def _median_cut(
    directions: Float64[np.ndarray, "texels 3"], power: Float64[np.ndarray, " texels"], count: int
) -> np.ndarray:
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


def _middles(
    directions: Float64[np.ndarray, "texels 3"], power: Float64[np.ndarray, " texels"], owner: np.ndarray
) -> Float64[np.ndarray, "parts 3"]:
    """The unit vector to the middle of each part's light; of one whose vectors cancel, its first texel."""
    parts = int(owner.max()) + 1
    sums = np.stack([np.bincount(owner, power * directions[:, axis], parts) for axis in range(3)], axis=1)
    first = directions[np.unique(owner, return_index=True)[1]]
    total = np.bincount(owner, power, parts)
    length = np.linalg.norm(sums, axis=1)
    return np.where((length > 1e-6 * total)[:, None], sums / np.maximum(length, 1e-300)[:, None], first)
