"""Fits intensity and falloff to captured views: the binned gather, the relative error and the fit, put together."""

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
from tuner.losses.relative_squared_error import Target, relative_squared_error, target_of
from tuner.search_space import SearchSpace
from tuner.virtual_point_lights import gather_inputs
from tuner.vpl_gather import FalloffParameters

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
    gathers, halves = [], []
    for index, view in enumerate(views):
        pixels = view.fitted_pixels(RECEIVERS_PER_VIEW, seed + index)
        receivers, vpls = gather_inputs(view.captured, pixels)
        gathers.append(bin_vpls(receivers, vpls, None if visibility is None else visibility[index][pixels]))
        flat = np.flatnonzero(view.captured.valid.ravel())[pixels]
        reference = view.reference
        halves.append(
            (reference.irradiance_a.reshape(-1, 3)[flat], reference.irradiance_b.reshape(-1, 3)[flat])
        )
    target = target_of(halves)
    point = space.point(start)
    lit = any(bool(jnp.any(gather.irradiance > 0.0)) for gather in gathers)
    if not (lit and bool(jnp.any(target.weight > 0.0))):
        return start, FitResult(point, np.nan, np.nan, np.array([np.nan]), FitStatus.NOTHING_LIT)
    result = fit(_loss(space), (tuple(gathers), target), point, steps=steps, progress=progress)
    if result.status.start_kept:
        return start, result
    return space.parameters(result.point, start), result


@lru_cache
def _loss(
    space: SearchSpace,
) -> Callable[[Float[Array, "parameters"], tuple[tuple[BinnedGather, ...], Target]], Float[Array, ""]]:
    # One function object for each space: the compiled fit is found again by it.
    def loss(point: Float[Array, "parameters"], data: tuple[tuple[BinnedGather, ...], Target]) -> Array:
        gathers, target = data
        parameters = FalloffParameters(**space.values(point))
        picture = jnp.concatenate([gather_binned(gather, parameters) for gather in gathers])
        return relative_squared_error(picture, target)

    return loss
