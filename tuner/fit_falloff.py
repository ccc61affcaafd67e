"""Fits intensity and falloff to captured views: binned gather, relative error and fit put together.

The picture is linear in the intensity k, so at every point of the other parameters the best k has a closed
form, and the fit moves over the others alone (variable projection, Golub and Pereyra 1973).
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from renderer.artist_parameters import ARTIST_PARAMETERS, ArtistParameters
from tuner.binned_gather import bin_vpls
from tuner.captured_view import CapturedView
from tuner.descent import STEPS, Residuals, descend
from tuner.fit_status import Descent, FitStatus
from tuner.losses.relative_squared_error import EVEN_SHARE, target_of
from tuner.reduced_gather import ReducedGather, reduce_gather, reduced_picture
from tuner.search_space import SearchSpace
from tuner.virtual_point_lights import gather_inputs
from tuner.vpl_gather import FalloffParameters
from tuner.vpl_visibility import map_visibility

Data = tuple[ReducedGather, ...]

RECEIVERS_PER_VIEW = 4096
"""Pixels of each view that the fit looks at: three parameters need no more, and memory stays bounded."""

_INTENSITY = next(spec for spec in ARTIST_PARAMETERS if spec.name == "intensity")


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
    data = tuple(
        _reduced_view(
            view, seed + index, even_share, start, None if visibility is None else visibility[index]
        )
        for index, view in enumerate(views)
    )
    if not any(jnp.any(view.factor != 0.0) for view in data):
        point = SearchSpace().point(start)
        return start, Descent(point, np.nan, np.nan, np.array([np.nan]), FitStatus.NOTHING_LIT)
    return _fit(data, start, steps, progress)


def _fit(
    data: Data, start: ArtistParameters, steps: int, progress: Callable[[float], None] | None
) -> tuple[ArtistParameters, Descent]:
    """Moves over all parameters but k, and reports as if it had moved over all of them."""
    offset = float(sum(view.offset for view in data)) / len(data)
    start_loss = float(_squares(FalloffParameters.of(start), data)) + offset
    others = SearchSpace(tuple(spec for spec in SearchSpace().specs if spec is not _INTENSITY))
    found = descend(
        _residuals(others), data, others.point(start), offset=offset, steps=steps, progress=progress
    )
    tuned = others.parameters(found.point, start)
    tuned = replace(tuned, intensity=float(_best_intensity(FalloffParameters.of(tuned), data)))
    status = found.status
    if not found.loss < start_loss:
        status = FitStatus.NOT_FINITE if status.failed else FitStatus.NO_IMPROVEMENT
        tuned = start
    elif status is FitStatus.NO_IMPROVEMENT:
        # The closed form alone has done it.
        status = FitStatus.CONVERGED
    losses = np.concatenate([[start_loss], found.losses])
    descent = Descent(SearchSpace().point(tuned), min(found.loss, start_loss), start_loss, losses, status)
    return tuned, descent


def _reduced_view(
    view: CapturedView,
    seed: int,
    even_share: float,
    parameters: ArtistParameters,
    visibility: Bool[np.ndarray, "receivers vpls"] | None,
) -> ReducedGather:
    pixels = view.fitted_pixels(RECEIVERS_PER_VIEW, seed)
    receivers, vpls = gather_inputs(view.captured, pixels)
    if visibility is None:
        seen = map_visibility(view.captured, receivers, vpls, parameters)
    else:
        seen = visibility[pixels]
    flat = np.flatnonzero(view.captured.valid.ravel())[pixels]
    halves = (view.reference.irradiance_a, view.reference.irradiance_b)
    target = target_of(*(half.reshape(-1, 3)[flat] for half in halves), even_share)
    return reduce_gather(bin_vpls(receivers, vpls, seen), target)


def _pictures_and_targets(falloff: FalloffParameters, data: Data) -> tuple[Array, Array]:
    pictures = jnp.concatenate([reduced_picture(view, falloff) for view in data])
    return pictures, jnp.concatenate([view.target for view in data])


def _projected(pictures: Array, targets: Array) -> Float[Array, ""]:
    """argmin over k in its range of |k·pictures − targets|²."""
    product = partial(jnp.matmul, precision=jax.lax.Precision.HIGHEST)
    # 1e-30: where no light arrives at all, any k will do.
    best = product(pictures, targets) / jnp.maximum(product(pictures, pictures), 1e-30)
    return jnp.clip(best, _INTENSITY.low, _INTENSITY.high)


@jax.jit
def _best_intensity(falloff: FalloffParameters, data: Data) -> Float[Array, ""]:
    return _projected(*_pictures_and_targets(replace(falloff, intensity=jnp.ones(())), data))


@jax.jit
def _squares(falloff: FalloffParameters, data: Data) -> Float[Array, ""]:
    pictures, targets = _pictures_and_targets(falloff, data)
    return jnp.sum((pictures - targets) ** 2) / len(data)


@lru_cache
def _residuals(space: SearchSpace) -> Residuals:
    # One function object for each space: the compiled fit is found again by it.
    def residuals(point: Float[Array, "parameters"], data: Data) -> Array:
        falloff = FalloffParameters(intensity=jnp.ones(()), **space.values(point))
        pictures, targets = _pictures_and_targets(falloff, data)
        return (_projected(pictures, targets) * pictures - targets) / np.sqrt(len(data))

    return residuals
