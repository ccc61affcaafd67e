"""Fits intensity and falloff to captured views: binned gather, relative error and fit put together."""

from collections.abc import Callable
from functools import lru_cache

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from renderer.artist_parameters import ArtistParameters
from tuner.binned_gather import BinnedGather, bin_vpls, gather_binned
from tuner.captured_view import CapturedView
from tuner.fit import STEPS, fit
from tuner.fit_result import FitResult, FitStatus
from tuner.losses.mean_level_error import mean_level_error
from tuner.losses.relative_squared_error import Target, relative_squared_error, target_of
from tuner.search_space import SearchSpace
from tuner.virtual_point_lights import gather_inputs
from tuner.vpl_gather import FalloffParameters

Data = tuple[tuple[BinnedGather, Target], ...]

MEAN_LEVEL_WEIGHT = 1.0
"""Of the mean level beside relMSE. On five scenes 1 cost 1 to 8 % of relMSE and took the energy's error
from 0.77–0.99 to 0.83–1.02 of the reference; 0 dims the picture, 3 costs three times as much."""
RECEIVERS_PER_VIEW = 4096
"""Pixels of each view that the fit looks at: three parameters need no more, and memory stays bounded."""


def fit_falloff(
    views: tuple[CapturedView, ...],
    start: ArtistParameters,
    *,
    seed: int = 0,
    steps: int = STEPS,
    visibility: tuple[Bool[np.ndarray, "receivers vpls"], ...] | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[ArtistParameters, FitResult]:
    """The parameters that bring the views closest to their references, all views counting the same.

    Args:
        views: what to fit to; at least one.
        start: where to begin, and what the other parameters stay at.
        seed: of the choice of pixels.
        visibility: for each view, of every valid pixel and VPL; None takes all as visible, as the
            runtime does.
        progress: called with the share done, in [0, 1].
    """
    space = SearchSpace()
    data = tuple(
        _binned_view(view, seed + index, None if visibility is None else visibility[index])
        for index, view in enumerate(views)
    )
    point = space.point(start)
    if not any(jnp.any(gather.irradiance > 0.0) and jnp.any(target.weight > 0.0) for gather, target in data):
        return start, FitResult(point, np.nan, np.nan, np.array([np.nan]), FitStatus.NOTHING_LIT)
    result = fit(_loss(space), data, point, steps=steps, progress=progress)
    if result.status.start_kept:
        return start, result
    return space.parameters(result.point, start), result


def _binned_view(
    view: CapturedView, seed: int, visibility: Bool[np.ndarray, "receivers vpls"] | None
) -> tuple[BinnedGather, Target]:
    pixels = view.fitted_pixels(RECEIVERS_PER_VIEW, seed)
    receivers, vpls = gather_inputs(view.captured, pixels)
    binned = bin_vpls(receivers, vpls, None if visibility is None else visibility[pixels])
    flat = np.flatnonzero(view.captured.valid.ravel())[pixels]
    halves = (view.reference.irradiance_a, view.reference.irradiance_b)
    return binned, target_of(*(half.reshape(-1, 3)[flat] for half in halves))


@lru_cache
def _loss(space: SearchSpace) -> Callable[[Float[Array, "parameters"], Data], Float[Array, ""]]:
    # One function object for each space: the compiled fit is found again by it.
    def loss(point: Float[Array, "parameters"], data: Data) -> Array:
        parameters = FalloffParameters(**space.values(point))
        total = jnp.float32(0.0)
        for gather, target in data:
            picture = gather_binned(gather, parameters)
            total += relative_squared_error(picture, target)
            total += MEAN_LEVEL_WEIGHT * mean_level_error(picture, target)
        return total / len(data)

    return loss
