"""Computes the skies of Mitsuba scenes with Mitsuba's own plugin, `sunsky` (Hošek and Wilkie 2012, 2013)."""

import contextlib
import math
from collections.abc import Callable, Iterator

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.mitsuba_import.sun_sky import FROM_MAP, SUN_APERTURE, BakedSunSky, SunSky

ROWS, COLUMNS = 256, 512
"""A choice: the size of a sky's map. With four times the texels, level ground gets the same within 1e-4."""
# A choice: rings, and directions in each, over which the sun's disc is integrated (Gauss and Legendre).
_RINGS, _SPOKES = 8, 16
# A choice: how far above the horizon the sky is looked up for directions below it, in radians.
_ABOVE_HORIZON = 1e-4
Radiance = Callable[[Float64[np.ndarray, "rays 3"]], Float64[np.ndarray, "rays 3"]]
"""The radiance from directions in the axes of a map."""


def baked_sun_sky(model: SunSky) -> BakedSunSky:
    """The sky's map, and the sun's irradiance and direction.

    The sun's irradiance is its radiance times the cosine to its middle, integrated over its disc.
    """
    with _scalar_mitsuba() as mitsuba:
        given = dict(model.moment) if model.towards_sun is None else _direction(model.towards_sun)
        towards = _towards_sun(mitsuba, model, given)
        is_night = bool(towards[1] < 0.0)
        radiance, irradiance = np.zeros((ROWS, COLUMNS, 3), np.float32), np.zeros(3)
        if model.sky_scale and not is_night:
            radiance = _sky(model, _radiance(mitsuba, model, towards, "sky"))
        if model.sun_scale and not is_night:
            irradiance = model.sun_scale * _sun(
                towards, model.sun_aperture, _radiance(mitsuba, model, towards, "sun")
            )
    # Version 0.6 stretches the sun's place, but not its colour.
    polar = min(math.acos(min(max(towards[1], -1.0), 1.0)) * model.stretch, math.pi)
    azimuth = math.atan2(towards[0], -towards[2])
    return BakedSunSky(radiance, _unit_vectors(np.array(polar), np.array(azimuth)), irradiance, is_night)


@contextlib.contextmanager
def _scalar_mitsuba() -> Iterator:
    """Mitsuba in the variant that compiles nothing, and silent; what was set before is set again."""
    import mitsuba

    before = mitsuba.variant()
    mitsuba.set_variant("scalar_rgb")
    level = mitsuba.log_level()
    try:
        # It says that the sun is below the horizon, and so do we.
        mitsuba.set_log_level(mitsuba.LogLevel.Error)
        yield mitsuba
    finally:
        mitsuba.set_log_level(level)
        if before is not None and before != "scalar_rgb":
            mitsuba.set_variant(before)


def _direction(towards: tuple[float, float, float] | Float64[np.ndarray, "3"]) -> dict:
    return {"sun_direction": [float(x) for x in FROM_MAP @ np.asarray(towards)]}


def _towards_sun(mitsuba, model: SunSky, given: dict) -> Float64[np.ndarray, "3"]:
    """The unit vector towards the sun in the axes of the map."""
    if model.towards_sun is not None:
        return np.array(model.towards_sun)
    whole = {name: int(value) if name in ("year", "month", "day") else value for name, value in given.items()}
    plugin = mitsuba.load_dict({"type": "sunsky", **whole})
    x, y, z = np.array(mitsuba.traverse(plugin)["sun_direction"], np.float64).ravel()
    # Mitsuba 3 has the south along +X, the west along +Y.
    towards = np.array([-y, z, x]) if model.compass == "0.6" else FROM_MAP.T @ (x, y, z)
    return towards / np.linalg.norm(towards)


def _radiance(mitsuba, model: SunSky, towards_sun: Float64[np.ndarray, "3"], part: str) -> Radiance:
    """The radiance of the plugin's sky or sun, without its scale."""
    plugin = mitsuba.load_dict(
        {
            "type": "sunsky",
            "turbidity": model.turbidity,
            "albedo": {"type": "rgb", "value": list(model.albedo)},
            "sky_scale": float(part == "sky"),
            "sun_scale": float(part == "sun"),
            "sun_aperture": max(model.sun_aperture, SUN_APERTURE),
            "complex_sun": model.complex_sun,
            **_direction(towards_sun),
        }
    )
    interaction = mitsuba.SurfaceInteraction3f()

    def radiance(directions: Float64[np.ndarray, "rays 3"]) -> Float64[np.ndarray, "rays 3"]:
        found = np.empty(directions.shape)
        for i, towards_eye in enumerate((-directions @ FROM_MAP.T).tolist()):
            interaction.wi = towards_eye
            found[i] = plugin.eval(interaction)
        return found

    return radiance


def _sky(model: SunSky, radiance: Radiance) -> np.ndarray:
    """The map [ROWS, COLUMNS, 3] of the sky, each texel by its middle."""
    polar = np.pi * (np.arange(ROWS) + 0.5) / ROWS
    looked_up = polar / model.stretch
    shares = np.ones(ROWS)
    if model.extends:
        looked_up = np.minimum(looked_up, 0.5 * np.pi - _ABOVE_HORIZON)
        # A smooth step from 1 at the horizon to 0 at the nadir.
        t = np.clip(2.0 - 2.0 * polar / np.pi, 0.0, 1.0)
        shares = t * t * (3.0 - 2.0 * t)
    azimuth = 2.0 * np.pi * (np.arange(COLUMNS) + 0.5) / COLUMNS
    result = np.zeros((ROWS, COLUMNS, 3), np.float32)
    for row in np.flatnonzero(looked_up < 0.5 * np.pi):
        found = radiance(_unit_vectors(np.full(COLUMNS, looked_up[row]), azimuth))
        result[row] = model.sky_scale * shares[row] * found
    return result


def _sun(towards: Float64[np.ndarray, "3"], aperture: float, radiance: Radiance) -> Float64[np.ndarray, "3"]:
    """Irradiance on a surface that faces the sun.

    The plugin keeps the sun's flux for every aperture. So a sun below the default is taken as large as that,
    lest differences of cosines vanish in Mitsuba's single precision.
    """
    lowest = math.cos(math.radians(0.5 * max(aperture, SUN_APERTURE)))
    nodes, weights = np.polynomial.legendre.leggauss(_RINGS)
    cosine = lowest + (1.0 - lowest) * 0.5 * (nodes + 1.0)
    sine = np.sqrt(1.0 - cosine**2)
    across = np.cross(towards, np.eye(3)[np.abs(towards).argmin()])
    across /= np.linalg.norm(across)
    turn = 2.0 * np.pi * (np.arange(_SPOKES) + 0.5) / _SPOKES
    ring = np.outer(np.cos(turn), across) + np.outer(np.sin(turn), np.cross(towards, across))
    directions = cosine[:, None, None] * towards + sine[:, None, None] * ring
    angle = 2.0 * np.pi * (1.0 - lowest) * 0.5 * weights / _SPOKES
    found = radiance(directions.reshape(-1, 3)).reshape(_RINGS, _SPOKES, 3)
    return np.einsum("r,rsc->c", angle * cosine, found)


def _unit_vectors(
    polar: Float64[np.ndarray, "*rays"], azimuth: Float64[np.ndarray, "*rays"]
) -> Float64[np.ndarray, "*rays 3"]:
    sine = np.sin(polar)
    return np.stack([sine * np.sin(azimuth), np.cos(polar), -sine * np.cos(azimuth)], axis=-1)
