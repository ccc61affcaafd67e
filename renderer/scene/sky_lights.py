"""An environment as lights with shadow maps, for what they send on, and as rays, for direct light.

Each part of the sky is a directional light from the middle of its light: what its reflective shadow map shows
becomes VPLs. Surfaces that see half of a part would err by some percent; so all lights are weighted a little,
to give surfaces of every orientation the irradiance of the sky itself.

Shadows from so few directions would be hard, and so direct light comes along rays: each part is cut again.
Only the light of narrow parts, such as a sun's, has its shadows from its map.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float32, Float64, Int64

from vpltune.renderer.scene.environment import Environment
from vpltune.renderer.scene.scene import Light
from vpltune.renderer.scene.sky_parts import ROWS, SkyParts, median_cut, part_middles, sky_parts

RAYS = 1024
"""Directions that all parts together are cut into, about; fewer where the sky has fewer lit texels. A choice:
a pixel takes 16 of them."""
LEAST_RAYS_OF_A_PART = 32
"""Rays that a part has however many parts there are, unless it has fewer texels. A choice."""
TEXEL = np.pi / ROWS
"""Angle in radians that a texel is high, and wide at the horizon."""
_NARROW = 0.06
"""Widest half angle in radians of a part with hard shadows. A choice, 3.4°: about one texel of the map
that is cut, which is all that is known of a sun's size."""
_AXES_COUNT = 30.0
"""How much more surfaces along the six axes count, as most floors and walls are. A choice."""
_ORIENTATIONS = 400
"""Orientations of surfaces whose irradiance is put right. A choice: 10° apart."""
_RIDGE = 1e-3
"""Weight of a factor's change beside the relative squared error. A choice: changes of some percent."""
_MOST_CHANGE = 0.3
"""Largest change of a factor; of a smaller part, its half angle. A choice."""


@dataclass(frozen=True, eq=False)
class SkyLights:
    """What stands for a sky."""

    lights: tuple[Light, ...] = ()
    """Directional; intensities are W/m² on a surface square to the light. The narrow ones come first."""
    narrow: int = 0
    """How many are narrow: their direct light has shadows from their maps, and comes along no ray."""
    ray_towards: Float32[np.ndarray, "rays 3"] = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    """Unit vectors towards the light of the other parts, part by part; parts that follow are neighbours."""
    ray_flux: Float32[np.ndarray, "rays 3"] = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    """W/m² on a surface square to each."""
    texel_towards: Float32[np.ndarray, "texels 3"] = field(
        default_factory=lambda: np.zeros((0, 3), np.float32)
    )
    """Unit vectors towards the texels that the rays stand for, ray by ray; texels are `TEXEL` wide."""
    texel_flux: Float32[np.ndarray, "texels 3"] = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    """W/m² on a surface square to each; those of a ray add up to its own."""
    ray_texels: Int64[np.ndarray, "rays 2"] = field(default_factory=lambda: np.zeros((0, 2), np.int64))
    """First and number of each ray's texels."""

    def open_irradiance(self, normals: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
        """W/m² along the rays on surfaces with these unit normals that nothing hides."""
        return np.maximum(normals @ self.ray_towards.T, 0.0) @ self.ray_flux


def sky_lights(environment: Environment, count: int) -> SkyLights:
    """What stands for an environment: at most `count` lights, fewer where it has fewer lit texels."""
    parts = sky_parts(environment, count)
    if not parts.count:
        return SkyLights()
    middles = parts.middles()
    angles = _half_angles(parts, middles)
    narrow = angles <= _NARROW
    weights = _weights(parts, middles, np.where(narrow, 0.0, np.minimum(angles, _MOST_CHANGE)))
    fluxes = [weight * parts.flux[parts.owner == i].sum(axis=0) for i, weight in enumerate(weights)]
    # A stable order: the narrow ones first.
    lights = tuple(
        Light("directional", fluxes[i], direction_world=-middles[i], name="sky")
        for i in np.argsort(~narrow, kind="stable")
    )
    return _with_rays(SkyLights(lights, int(narrow.sum())), parts, middles, np.flatnonzero(~narrow))


def _half_angles(parts: SkyParts, middles: Float64[np.ndarray, "parts 3"]) -> Float64[np.ndarray, " parts"]:
    """Half angle in radians of the even disc of sky with a part's mean cosine, which is (1 + cos θ)/2."""
    cosines = (parts.directions * middles[parts.owner]).sum(axis=1)
    mean = np.bincount(parts.owner, parts.power * cosines) / np.bincount(parts.owner, parts.power)
    return np.arccos(np.clip(2.0 * mean - 1.0, -1.0, 1.0))


def _with_rays(
    sky: SkyLights,
    parts: SkyParts,
    middles: Float64[np.ndarray, "parts 3"],
    wide: Int64[np.ndarray, " wide"],
) -> SkyLights:
    """`sky` with rays to the wide parts."""
    if not len(wide):
        return sky
    most = max(LEAST_RAYS_OF_A_PART, RAYS // len(wide))
    order: list[np.ndarray] = []  # texels, ray by ray
    rays: list[np.ndarray] = []  # the ray of each of them
    towards: list[np.ndarray] = []
    for part in _chained(middles, wide):
        own = np.flatnonzero(parts.owner == part)
        piece = median_cut(parts.directions[own], parts.power[own], most)
        piece_middles = part_middles(parts.directions[own], parts.power[own], piece)
        # Neighbours in the chain are neighbours in the sky: where one is seen, the next may be.
        chain = _chained(piece_middles, np.arange(len(piece_middles)))
        place = np.argsort(chain)[piece]
        order.append(own[np.argsort(place, kind="stable")])
        rays.append(np.sort(place) + sum(map(len, towards)))
        towards.append(piece_middles[chain])
    texels, ray = np.concatenate(order), np.concatenate(rays)
    count = np.bincount(ray)
    flux = parts.flux[texels]
    return replace(
        sky,
        ray_towards=np.concatenate(towards).astype(np.float32),
        ray_flux=np.stack([np.bincount(ray, each) for each in flux.T], axis=1).astype(np.float32),
        texel_towards=parts.directions[texels].astype(np.float32),
        texel_flux=flux.astype(np.float32),
        ray_texels=np.stack([np.cumsum(count) - count, count], axis=1),
    )


def _chained(middles: Float64[np.ndarray, "parts 3"], chosen: Int64[np.ndarray, " chosen"]) -> list[int]:
    """The chosen parts, each near the one before, so that every second of them covers the sky evenly."""
    left = [int(part) for part in chosen]
    chain: list[int] = []
    while left:
        nearest = max(left, key=lambda part: middles[part] @ middles[chain[-1]]) if chain else left[0]
        left.remove(nearest)
        chain.append(nearest)
    return chain


def _weights(
    parts: SkyParts, middles: Float64[np.ndarray, "parts 3"], most: Float64[np.ndarray, " parts"]
) -> Float64[np.ndarray, " parts"]:
    """Factors of the lights' power, by least squares over the irradiance of surfaces of many orientations.

    Ridge regression (Hoerl and Kennard 1970) towards 1, from which a factor differs by `most` at most: the
    middle of a small part is as good as the part.
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

    wanted = seen(parts.directions) @ parts.power
    given = seen(middles) * np.bincount(parts.owner, parts.power)
    scale = max(wanted.mean(), 1e-300)
    matrix, missing = given / scale, (wanted - given.sum(axis=1)) / scale
    weighted = matrix.T * (counts / counts.sum())
    change = np.linalg.solve(weighted @ matrix + _RIDGE * np.eye(len(middles)), weighted @ missing)
    return 1.0 + np.clip(change, -most, most)


def _even_directions(count: int) -> Float64[np.ndarray, "count 3"]:
    """Unit vectors spread evenly: a spherical Fibonacci lattice (González 2010)."""
    y = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - y * y)
    return np.stack([radius * np.cos(angle), y, radius * np.sin(angle)], axis=1)
