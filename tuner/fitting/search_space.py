"""Fitted parameters as a point of the unit cube; their ranges are those of `ARTIST_PARAMETERS`."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Array, Float

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters, ParameterSpec

VISIBILITY_SPECS = tuple(spec for spec in ARTIST_PARAMETERS if spec.name.startswith("visibility_"))
"""Bias and softness of visibility maps, fitted in alternation with the falloff (`fit_visibility`)."""
FALLOFF_SPECS = tuple(spec for spec in ARTIST_PARAMETERS if spec.fitted and spec not in VISIBILITY_SPECS)
"""All other fitted parameters: intensity and falloff."""


@dataclass(frozen=True)
class SearchSpace:
    """Maps the unit cube to parameter values, each axis on the scale of its parameter (linear or log)."""

    specs: tuple[ParameterSpec, ...] = FALLOFF_SPECS
    """The parameters, one for each axis."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of the axes."""
        return tuple(spec.name for spec in self.specs)

    def values(self, point: Float[Array, "parameters"]) -> dict[str, Float[Array, ""]]:
        """Parameter values by name at a point of the unit cube; differentiable."""
        return {spec.name: spec.value_at(point[i]) for i, spec in enumerate(self.specs)}

    def point(self, parameters: ArtistParameters) -> Float[np.ndarray, "parameters"]:
        """The point of the unit cube at which these parameters lie."""
        return np.array([spec.place_of(getattr(parameters, spec.name)) for spec in self.specs])

    def parameters(self, point: Float[np.ndarray, "parameters"], rest: ArtistParameters) -> ArtistParameters:
        """The parameters at a point, clipped to the cube; parameters without an axis are those of `rest`."""
        inside = np.clip(np.asarray(point, np.float64), 0.0, 1.0)
        values = {spec.name: spec.within(float(at)) for spec, at in zip(self.specs, inside, strict=True)}
        return ArtistParameters(**{**rest.as_dict(), **values})
