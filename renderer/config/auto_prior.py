"""A learnt prior: the parameters as a small function of what the GPU measures of a scene.

    point = clamp(weights · statistics + bias, lowest, highest)

in the unit cube of the parameter table, each axis linear or logarithmic as the table says. Twins:
shaders/auto_parameters/auto_parameters.comp, and `tuner.prior.prior_training` in JAX.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.scene_statistics import STATISTIC_NAMES
from vpltune.renderer.errors import InputError

AUTO_PARAMETERS = ("intensity", "falloff_footprint", "visibility_bias", "visibility_softness")
"""What a prior sets: what acts after VPLs are placed and their maps cast, when statistics are known. Not κ: a
fit trades it for intensity, and a prior that set it too was worse than the defaults on scenes new to it."""

LARGEST_WEIGHT = 1e6
"""Keeps float32 from overflowing; a useful weight is some 1."""

Vector = tuple[float, ...]
Matrix = tuple[Vector, ...]

_KEYS = ("statistics", "parameters", "weights", "bias", "lowest", "highest")


@dataclass(frozen=True)
class AutoPrior:
    """The weights, as a config file holds them."""

    weights: Matrix
    """[parameters, statistics]"""
    bias: Vector
    lowest: Vector
    highest: Vector
    """The part of the unit cube that it was trained in, and never leaves."""

    def point(self, statistics: Float64[np.ndarray, " statistics"]) -> Float64[np.ndarray, "parameters"]:
        """Where in the unit cube, of the axes `AUTO_PARAMETERS`."""
        free = np.array(self.weights) @ statistics + np.array(self.bias)
        return np.clip(free, self.lowest, self.highest)

    def parameters(
        self, statistics: Float64[np.ndarray, " statistics"], rest: ArtistParameters
    ) -> ArtistParameters:
        """The parameters for a scene with these statistics; those that a prior does not set, from `rest`."""
        values = {
            name: parameter_spec(name).within(float(place))
            for name, place in zip(AUTO_PARAMETERS, self.point(statistics), strict=True)
        }
        return ArtistParameters(**{**rest.as_dict(), **values})

    def as_dict(self) -> dict[str, Any]:
        """As a config file holds it."""
        return {
            "statistics": list(STATISTIC_NAMES),
            "parameters": list(AUTO_PARAMETERS),
            "weights": [list(row) for row in self.weights],
            "bias": list(self.bias),
            "lowest": list(self.lowest),
            "highest": list(self.highest),
        }

    @classmethod
    def validated(cls, values: Any, where: str) -> "AutoPrior":
        """A prior from a file's content; `where` names it in errors.

        Raises:
            InputError: a key is unknown or missing, a size does not fit, a number is not finite or too large,
                or statistics or parameters are other than this program's own.
        """
        if not isinstance(values, Mapping):
            raise InputError(f"{where}: must be an object, got {type(values).__name__}")
        for key in values:
            if key not in _KEYS:
                raise InputError(f"{where}: unknown key {key!r:.60}; known are {', '.join(_KEYS)}")
        for key in _KEYS:
            if key not in values:
                raise InputError(f"{where}: key '{key}' is missing")
        for key, names in (("statistics", STATISTIC_NAMES), ("parameters", AUTO_PARAMETERS)):
            if values[key] != list(names):
                raise InputError(f"{where}.{key}: must be {', '.join(names)}, got {values[key]!r:.60}")
        count = len(AUTO_PARAMETERS)
        weights = _matrix(values["weights"], count, len(STATISTIC_NAMES), f"{where}.weights")
        bias, lowest, highest = (
            _vector(values[key], count, f"{where}.{key}") for key in ("bias", "lowest", "highest")
        )
        for name, low, high in zip(AUTO_PARAMETERS, lowest, highest, strict=True):
            if not 0.0 <= low <= high <= 1.0:
                raise InputError(
                    f"{where}: 0 ≤ lowest ≤ highest ≤ 1 must hold, got {low} and {high} of {name}"
                )
        return cls(weights, bias, lowest, highest)


def auto_schema() -> dict[str, Any]:
    """JSON Schema of the key `auto`."""
    count = len(AUTO_PARAMETERS)

    def vector(items: dict[str, Any], length: int) -> dict[str, Any]:
        return {"type": "array", "items": items, "minItems": length, "maxItems": length}

    def between(low: float, high: float) -> dict[str, Any]:
        # As for parameters: `minimum` once more, turned round, so that NaN does not pass.
        return {"type": "number", "minimum": low, "maximum": high, "not": {"exclusiveMaximum": low}}

    weight, place = between(-LARGEST_WEIGHT, LARGEST_WEIGHT), between(0.0, 1.0)
    return {
        "description": "Parameters as a function of what the GPU measures: "
        "point = clamp(weights · statistics + bias, lowest, highest), in the unit cube of their ranges.",
        "type": "object",
        "required": list(_KEYS),
        "additionalProperties": False,
        "properties": {
            "statistics": {"const": list(STATISTIC_NAMES)},
            "parameters": {"const": list(AUTO_PARAMETERS)},
            "weights": vector(vector(weight, len(STATISTIC_NAMES)), count),
            "bias": vector(weight, count),
            "lowest": vector(place, count),
            "highest": vector(place, count),
        },
    }


def _vector(values: Any, count: int, where: str) -> Vector:
    if not isinstance(values, list) or len(values) != count:
        raise InputError(f"{where}: must be a list of {count} numbers, got {values!r:.60}")
    for value in values:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        # False for NaN, and made before float(), which overflows on 10**400.
        if not number or not -LARGEST_WEIGHT <= value <= LARGEST_WEIGHT:
            raise InputError(f"{where}: weights are from -1e6 to 1e6, got {value!r:.60}")
    return tuple(float(value) for value in values)


def _matrix(values: Any, rows: int, columns: int, where: str) -> Matrix:
    if not isinstance(values, list) or len(values) != rows:
        raise InputError(f"{where}: must be a list of {rows} rows, got {values!r:.60}")
    return tuple(_vector(row, columns, f"{where}[{index}]") for index, row in enumerate(values))
