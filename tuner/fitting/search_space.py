"""The fitted parameters as a point of the unit cube, from the one table that owns their ranges."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Array, Float

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters, ParameterSpec

VISIBILITY_SPECS = tuple(spec for spec in ARTIST_PARAMETERS if spec.name.startswith("visibility_"))
"""Those of visibility maps, fitted in turns with the others (`tuner.fitting.fit_visibility`)."""
FALLOFF_SPECS = tuple(spec for spec in ARTIST_PARAMETERS if spec.fitted and spec not in VISIBILITY_SPECS)


@dataclass(frozen=True)
class SearchSpace:
    """Maps the unit cube to parameter values: each axis linear or logarithmic, as the table says."""

    specs: tuple[ParameterSpec, ...] = FALLOFF_SPECS

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters' names, in the table's order."""
        return tuple(spec.name for spec in self.specs)

    def values(self, point: Float[Array, "parameters"]) -> dict[str, Float[Array, ""]]:
        """Differentiable: parameter values by name at a point of the unit cube."""
        return {spec.name: spec.value_at(point[i]) for i, spec in enumerate(self.specs)}

    def point(self, parameters: ArtistParameters) -> Float[np.ndarray, "parameters"]:
        """Where `parameters` lie in the unit cube."""
        return np.array([spec.place_of(getattr(parameters, spec.name)) for spec in self.specs])

    def parameters(self, point: Float[np.ndarray, "parameters"], rest: ArtistParameters) -> ArtistParameters:
        """The parameters at a point; those that are not fitted are taken from `rest`."""
        inside = np.clip(np.asarray(point, np.float64), 0.0, 1.0)
        values = {spec.name: spec.within(float(at)) for spec, at in zip(self.specs, inside, strict=True)}
        return ArtistParameters(**{**rest.as_dict(), **values})
