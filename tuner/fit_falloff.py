"""Fits intensity and falloff to captured views: binned gather, relative error and fit put together."""

from collections.abc import Callable
from functools import lru_cache

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from renderer.artist_parameters import ArtistParameters
from tuner.binned_gather import BinnedGather, bin_vpls, gather_binned
from tuner.captured_view import CapturedView
from tuner.descent import STEPS, descend
from tuner.fit_status import Descent, FitStatus
from tuner.losses.relative_squared_error import EVEN_SHARE, Target, target_of, weighted_squared_error
from tuner.search_space import SearchSpace
from tuner.virtual_point_lights import gather_inputs
from tuner.vpl_gather import FalloffParameters
from tuner.vpl_visibility import map_visibility

Data = tuple[tuple[BinnedGather, Target], ...]

RECEIVERS_PER_VIEW = 4096
"""Pixels of each view that the fit looks at: three parameters need no more, and memory stays bounded."""


def fit_falloff(
    views: tuple[CapturedView, ...],
    start: ArtistParameters,
    *,
    seed: int = 0,
    steps: int = STEPS,
    visibility: tuple[Bool[np.ndarray, "receivers vpls"], ...] | None = None,
    even_share: float = EVEN_SHARE,
    progress: Callable[[float], None] | None = None,
) -> tuple[ArtistParameters, Descent]:
    """The parameters that bring the views closest to their references, all views counting the same.

    Args:
        views: what to fit to; at least one.
        start: where to begin, and what the other parameters stay at.
        seed: of the choice of pixels.
        visibility: for each view, of every valid pixel and VPL; None takes what the runtime itself knows
            of it, from the views' visibility maps where they have them.
        even_share: weight of plain squared error beside relMSE, see `tuner.losses`.
        progress: called with the share done, in [0, 1].
    """
    space = SearchSpace()
    data = tuple(
        _binned_view(view, seed + index, even_share, start, None if visibility is None else visibility[index])
        for index, view in enumerate(views)
    )
    point = space.point(start)
    if not any(jnp.any(gather.irradiance > 0.0) and jnp.any(target.weight > 0.0) for gather, target in data):
        return start, Descent(point, np.nan, np.nan, np.array([np.nan]), FitStatus.NOTHING_LIT)
    result = descend(_loss(space), data, point, steps=steps, progress=progress)
    if result.status.start_kept:
        return start, result
    return space.parameters(result.point, start), result


def _binned_view(
    view: CapturedView,
    seed: int,
    even_share: float,
    parameters: ArtistParameters,
    visibility: Bool[np.ndarray, "receivers vpls"] | None,
) -> tuple[BinnedGather, Target]:
    pixels = view.fitted_pixels(RECEIVERS_PER_VIEW, seed)
    receivers, vpls = gather_inputs(view.captured, pixels)
    if visibility is None:
        seen = map_visibility(view.captured, receivers, vpls, parameters)
    else:
        seen = visibility[pixels]
    binned = bin_vpls(receivers, vpls, seen)
    flat = np.flatnonzero(view.captured.valid.ravel())[pixels]
    halves = (view.reference.irradiance_a, view.reference.irradiance_b)
    return binned, target_of(*(half.reshape(-1, 3)[flat] for half in halves), even_share)


@lru_cache
def _loss(space: SearchSpace) -> Callable[[Float[Array, "parameters"], Data], Float[Array, ""]]:
    # One function object for each space: the compiled fit is found again by it.
    def loss(point: Float[Array, "parameters"], data: Data) -> Array:
        parameters = FalloffParameters(**space.values(point))
        errors = [
            weighted_squared_error(gather_binned(gather, parameters), target) for gather, target in data
        ]
        return sum(errors) / len(data)

    return loss
