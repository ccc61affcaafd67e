"""The fitted parameters as a point of the unit cube, from the one table that owns their ranges."""

from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters, ParameterSpec
from vpltune.renderer.config.tuned_config import Visibility

VISIBILITY_SPECS = tuple(spec for spec in ARTIST_PARAMETERS if spec.name.startswith("visibility_"))
"""Those of visibility maps, fitted in turns with the others (`tuner.fitting.fit_visibility`)."""
FALLOFF_SPECS = tuple(spec for spec in ARTIST_PARAMETERS if spec.fitted and spec not in VISIBILITY_SPECS)


def held_for(visibility: Visibility) -> frozenset[str]:
    """Parameters that the runtime does not look at with `visibility`, and a fit must not move."""
    return frozenset({"extinction_coefficient"}) if visibility == "none" else frozenset()


@dataclass(frozen=True)
class SearchSpace:
    """Maps the unit cube to parameter values: each axis linear or logarithmic, as the table says."""

    specs: tuple[ParameterSpec, ...] = FALLOFF_SPECS

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(spec.name for spec in self.specs)

    def values(self, point: Float[Array, "parameters"]) -> dict[str, Float[Array, ""]]:
        """Differentiable: parameter values by name at a point of the unit cube."""
        return {
            spec.name: jnp.exp(jnp.log(spec.low) + point[i] * jnp.log(spec.high / spec.low))
            if spec.scale == "log"
            else spec.low + point[i] * (spec.high - spec.low)
            for i, spec in enumerate(self.specs)
        }

    def point(self, parameters: ArtistParameters) -> Float[np.ndarray, "parameters"]:
        """Where `parameters` lie in the unit cube."""
        given = parameters.as_dict()
        return np.array(
            [
                np.log(given[spec.name] / spec.low) / np.log(spec.high / spec.low)
                if spec.scale == "log"
                else (given[spec.name] - spec.low) / (spec.high - spec.low)
                for spec in self.specs
            ]
        )

    def parameters(self, point: Float[np.ndarray, "parameters"], rest: ArtistParameters) -> ArtistParameters:
        """The parameters at a point; those that are not fitted are taken from `rest`."""
        values = {}
        for spec, place in zip(self.specs, np.clip(np.asarray(point, np.float64), 0.0, 1.0), strict=True):
            if spec.scale == "log":
                value = spec.low * (spec.high / spec.low) ** place
            else:
                value = spec.low + place * (spec.high - spec.low)
            # Rounding may step over a bound by an ulp, and a config reader is strict.
            values[spec.name] = float(min(max(value, spec.low), spec.high))
        return ArtistParameters(**{**rest.as_dict(), **values})
