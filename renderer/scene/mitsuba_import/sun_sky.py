"""Mitsuba's emitters that compute a sky: `sunsky`, and `sky`, `sun` and `sunsky` of version 0.6."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float32, Float64

from vpltune.renderer.scene.environment import Environment
from vpltune.renderer.scene.environment_baking import baked_environment
from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings
from vpltune.renderer.scene.files.limits import LARGEST_RADIOMETRIC
from vpltune.renderer.scene.mitsuba_import.environment_map import turn_of
from vpltune.renderer.scene.mitsuba_import.plugin_tree import Plugin
from vpltune.renderer.scene.mitsuba_import.values import unit_direction
from vpltune.renderer.scene.scene import Light

SUN_SKIES = ("sky", "sun", "sunsky")
"""The types of emitters that are read here."""
FROM_MAP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation from the axes of a map, +Y up, to those of Mitsuba 3's `sunsky`, +Z up."""
SUN_APERTURE = 0.5358
"""Mitsuba's default: the sun's apparent diameter in degrees."""

# Where and when the sun is looked at: the lowest and the highest value, and whether it is a whole number. The
# limits are a choice: some reckon longitudes up to 360°.
_MOMENT = {
    "latitude": (-90.0, 90.0, False),
    "longitude": (-360.0, 360.0, False),
    "timezone": (-24.0, 24.0, False),
    "year": (1.0, 9999.0, True),
    "month": (1.0, 12.0, True),
    "day": (1.0, 31.0, True),
    "hour": (0.0, 24.0, False),
    "minute": (0.0, 60.0, False),
    "second": (0.0, 60.0, False),
}
# Of version 3 and of version 0.6. What an emitter has no use for is passed over, as version 0.6 does.
_PARAMETERS = frozenset(
    (
        *_MOMENT, "albedo", "complex_sun", "extend", "resolution", "sampling_weight", "scale", "sky_scale",
        "stretch", "sun_aperture", "sun_direction", "sun_radius_scale", "sun_scale", "to_world", "turbidity",
    )
)  # fmt: skip


@dataclass(frozen=True)
class SunSky:
    """A sky model, with directions in the axes of its map: +Y is up, azimuths are those of `Environment`."""

    turbidity: float
    """How hazy the air is, in [1, 10]."""
    albedo: tuple[float, float, float]
    """The ground's albedo, RGB in [0, 1]."""
    towards_sun: tuple[float, float, float] | None
    """Unit vector; None if place and time give it."""
    moment: tuple[tuple[str, float], ...]
    """Place and time by Mitsuba's names. Mitsuba has defaults for what is not there."""
    compass: Literal["0.6", "3"]
    """Where the axes point: to the east along +X and to the north along −Z in version 0.6. Version 3 has a
    compass of its own."""
    sky_scale: float
    """Factor on the sky's radiance; 0 for no sky."""
    sun_scale: float
    """Factor on the sun's radiance; 0 for no sun."""
    sun_aperture: float
    """The sun's apparent diameter in degrees. Its flux does not depend on it."""
    complex_sun: bool
    """Whether the sun is darker at its limb."""
    stretch: float
    """Factor in [1, 2] on the angle from the zenith, for the sky and the sun. Only version 0.6 has it."""
    extends: bool
    """Whether the sky goes on below the horizon. Only version 0.6 has it."""


@dataclass(frozen=True, eq=False)
class BakedSunSky:
    """What a sky model gives, in the axes of its map."""

    radiance: Float32[np.ndarray, "height width 3"]
    """The sky without the sun, as in `Environment`. It may be negative where colours lie outside sRGB."""
    towards_sun: Float64[np.ndarray, "3"]
    """Unit vector."""
    sun_irradiance: Float64[np.ndarray, "3"]
    """On a surface that faces the sun, RGB in W/m². It may be negative where its colour lies outside sRGB."""
    is_night: bool
    """Whether the sun is below the horizon. Mitsuba's models are black then."""


Baker = Callable[[SunSky], BakedSunSky]
"""Computes a sky model. It needs Mitsuba, which the runtime does not have."""


def sun_sky(emitter: Plugin, is_old: bool) -> SunSky:
    """The sky model of an emitter.

    Args:
        emitter: a plugin of a type in `SUN_SKIES`.
        is_old: whether the scene file is of version 0.x.

    Raises:
        SceneFileError: a parameter is unknown or invalid.
    """
    for name in (*emitter.values, *(name for name, _ in emitter.children)):
        if name not in _PARAMETERS:
            raise SceneFileError(f"{emitter.where}: {name!r:.60} is not a parameter of it")
    if emitter.child("albedo") is not None:
        raise SceneFileError(f"{emitter.where}: 'albedo' must be a colour")
    is_old = _is_old(emitter, is_old)
    albedo = emitter.vector("albedo", (0.2, 0.2, 0.2) if is_old else (0.3, 0.3, 0.3))
    if not ((albedo >= 0.0).all() and (albedo <= 1.0).all()):
        raise SceneFileError(f"{emitter.where}: albedo must be from 0 to 1, got {albedo.tolist()}")
    red, green, blue = albedo.tolist()
    moment = tuple((name, _moment(emitter, name)) for name in _MOMENT if name in emitter.values)
    scale = _in_range(emitter, "scale", 1.0, 0.0, LARGEST_RADIOMETRIC)
    sky_scale = _in_range(emitter, "sky_scale", scale, 0.0, LARGEST_RADIOMETRIC)
    sun_scale = _in_range(emitter, "sun_scale", scale, 0.0, LARGEST_RADIOMETRIC)
    aperture = emitter.number("sun_aperture", SUN_APERTURE)
    if not 0.0 < aperture < 180.0:
        raise SceneFileError(f"{emitter.where}: sun_aperture must lie in (0, 180) degrees, got {aperture:g}")
    return SunSky(
        turbidity=_in_range(emitter, "turbidity", 3.0, 1.0, 10.0),
        albedo=(red, green, blue),
        towards_sun=_towards_sun(emitter, is_old, moment),
        moment=moment,
        compass="0.6" if is_old else "3",
        sky_scale=0.0 if emitter.type == "sun" else sky_scale,
        sun_scale=0.0 if emitter.type == "sky" else sun_scale,
        sun_aperture=aperture,
        complex_sun=emitter.flag("complex_sun", False),
        stretch=_in_range(emitter, "stretch", 1.0, 1.0, 2.0),
        extends=emitter.flag("extend", False),
    )


class SunSkyReader:
    """Reads the sky models of a scene: one sky and one sun of all of them.

    Args:
        is_old: whether the scene file is of version 0.x.
        bake: computes a model; None if that cannot be done here, which is said.
        warnings: takes a line for each approximation.
    """

    def __init__(self, is_old: bool, bake: Baker | None, warnings: Warnings):
        self._is_old, self._bake, self._warnings = is_old, bake, warnings
        self._has_sky = self._has_sun = False

    def read(self, emitter: Plugin, has_environment: bool) -> tuple[Environment | None, Light | None]:
        """The sky and the sun of an emitter, each None if it is black or the scene has one already.

        Args:
            emitter: a plugin of a type in `SUN_SKIES`.
            has_environment: whether the scene has an environment already.

        Raises:
            SceneFileError: a parameter is unknown or invalid.
        """
        model = sun_sky(emitter, self._is_old)
        if self._bake is None:
            self._warnings.add(
                f"emitter '{emitter.type}' is ignored: Mitsuba computes it, which needs vpltune[tuner]"
            )
            return None, None
        if model.sky_scale and (has_environment or self._has_sky):
            self._warnings.add(f"the sky of {emitter.where} is ignored: a scene has one environment")
            model = replace(model, sky_scale=0.0)
        if model.sun_scale and self._has_sun:
            self._warnings.add(f"the sun of {emitter.where} is ignored: a scene has one sun")
            model = replace(model, sun_scale=0.0)
        if not (model.sky_scale or model.sun_scale):
            return None, None
        self._has_sky |= model.sky_scale > 0.0
        self._has_sun |= model.sun_scale > 0.0
        return self._placed(emitter, model, self._bake(model))

    def _placed(
        self, emitter: Plugin, model: SunSky, baked: BakedSunSky
    ) -> tuple[Environment | None, Light | None]:
        if baked.is_night:
            self._warnings.add(f"emitter '{emitter.type}' is ignored: its sun is below the horizon")
            return None, None
        if model.compass == "0.6":
            self._warnings.add("the sky of Mitsuba 0.6 is computed by the model of Mitsuba 3")
        irradiance = np.maximum(baked.sun_irradiance, 0.0)
        if baked.radiance.min() < 0.0 or baked.sun_irradiance.min() < 0.0:
            self._warnings.add("a colour of the sky or the sun lies outside sRGB: what is negative becomes 0")
        brightest = max(float(baked.radiance.max()), float(irradiance.max()))
        if not brightest <= LARGEST_RADIOMETRIC:
            raise SceneFileError(f"{emitter.where}: it must give at most {LARGEST_RADIOMETRIC:g} W/m²")
        to_world = _map_to_world(emitter, model.compass == "0.6", self._warnings)
        sky = sun = None
        if model.sky_scale:
            red, green, blue = np.moveaxis(np.maximum(baked.radiance, np.float32(0.0)), -1, 0)
            sky = baked_environment((red, green, blue), to_world)
        if irradiance.any():
            self._warnings.add(
                "the sun is a directional light: its shadows are sharp, and its disc is not seen in the sky"
            )
            direction = -to_world @ baked.towards_sun
            sun = Light("directional", irradiance, direction_world=direction, name="sun")
        return sky, sun


def _is_old(emitter: Plugin, is_old: bool) -> bool:
    """Whether the emitter is one of version 0.6; of the other versions, none has `sky` and `sun`."""
    return is_old or emitter.type != "sunsky"


def _map_to_world(emitter: Plugin, is_old: bool, warnings: Warnings) -> Float64[np.ndarray, "3 3"]:
    turn = turn_of(emitter, warnings)
    return turn if is_old else turn @ FROM_MAP


def _towards_sun(
    emitter: Plugin, is_old: bool, moment: tuple[tuple[str, float], ...]
) -> tuple[float, float, float] | None:
    if "sun_direction" not in emitter.values:
        return None
    if moment:
        raise SceneFileError(f"{emitter.where}: must have sun_direction or {moment[0][0]}, not both")
    towards = unit_direction(emitter.vector("sun_direction", (0.0, 0.0, 1.0)), emitter.where)
    # That the transform stretches is said where the map is turned.
    x, y, z = (_map_to_world(emitter, is_old, Warnings()).T @ towards).tolist()
    return x, y, z


def _moment(emitter: Plugin, name: str) -> float:
    low, high, is_whole = _MOMENT[name]
    value = _in_range(emitter, name, low, low, high)
    if is_whole and not value.is_integer():
        raise SceneFileError(f"{emitter.where}: {name} must be a whole number, got {value:g}")
    return value


def _in_range(emitter: Plugin, name: str, absent: float, low: float, high: float) -> float:
    value = emitter.number(name, absent)
    if not (math.isfinite(value) and low <= value <= high):
        raise SceneFileError(f"{emitter.where}: {name} must be from {low:g} to {high:g}, got {value:g}")
    return value
