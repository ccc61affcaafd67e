"""Fits intensity, falloff, and the bias and softness of visibility maps, for one placement of the VPLs.

The robust error (`tuner.metrics.robust_error`) is minimised by iteratively reweighted least squares. Each
iteration, here called a turn, rebuilds the reduced problem of `tuner.surrogate.reduced_gather` with new
weights, which takes milliseconds, and fits the falloff to it. The first turn then fits bias and softness;
later turns do so as long as these still move. They move only where that lowers the loss enough
(`tuner.fitting.fit_visibility`), because in most scenes the loss is almost flat in them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.fitting.fit_falloff import fit_to
from vpltune.tuner.fitting.fit_status import Descent, FitStatus
from vpltune.tuner.fitting.fit_views import FitView, reweighted, view_pixels
from vpltune.tuner.fitting.fit_visibility import fit_maps
from vpltune.tuner.fitting.search_space import SearchSpace
from vpltune.tuner.metrics.relative_squared_error import weighted_squared_error
from vpltune.tuner.metrics.robust_error import RobustError
from vpltune.tuner.surrogate.captured_view import CapturedView
from vpltune.tuner.surrogate.tabulated_gather import TabulatedGather, gather_tabulated
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters

TURNS = 4
"""Default limit on the turns. A choice."""
Trace = Callable[[ArtistParameters, float], None]
"""Called with parameters and their cost, for someone who watches."""

SETTLED = 1e-3
"""The fit has converged when a turn lowers the cost by less than this share. A choice."""


@dataclass(frozen=True, eq=False)
class PlacementFit:
    """The best parameters met for one placement of the VPLs."""

    parameters: ArtistParameters
    descent: Descent
    """Its losses are the cost at the start and after every turn."""
    views: tuple[FitView, ...]
    """The views with the visibility of `parameters` and the weights of the last turn, ready for
    `tuner.fitting.uncertainty`."""


def fit_placement(
    views: Sequence[CapturedView],
    start: ArtistParameters,
    errors: Sequence[RobustError] | None = None,
    *,
    seed: int = 0,
    visibility: Sequence[Bool[np.ndarray, "_ vpls"]] | None = None,
    turns: int = TURNS,
    progress: Callable[[float], None] | None = None,
    traced: Trace | None = None,
) -> PlacementFit:
    """Fit to the references of views, which all count the same.

    Args:
        views: at least one. If all have visibility maps, bias and softness are fitted too.
        start: where to begin, and the values of all other parameters.
        errors: the robust error of each view, from `robust_errors` with the same seed; None minimises relMSE.
        seed: selects the pixels of each view.
        visibility: for each view, whether each VPL is visible from each pixel with a surface; replaces maps.
        turns: limit on the reweighting iterations.
        progress: called with the share done, in [0, 1].
        traced: called with the start and its cost, and with those of every turn.

    Returns:
        The best parameters met: those of the start with the status `NO_IMPROVEMENT` if none are better, or
        with the status of the descent if nothing could be fitted.
    """
    known = [None] * len(views) if visibility is None else visibility
    pixels = [view_pixels(view, seen, seed=seed) for view, seen in zip(views, known, strict=True)]
    current, tables = start, [each.table(start) for each in pixels]
    ready = [each.ready(table, None) for each, table in zip(pixels, tables, strict=True)]
    costs, found, maps_move = [_cost(ready, errors, start)], [start], True
    if traced is not None:
        traced(start, costs[0])
    for turn in range(turns):
        if errors is not None:
            ready = [
                reweighted(view, error, _image(view.table, current))
                for view, error in zip(ready, errors, strict=True)
            ]
        current, descent = fit_to(tuple(ready), current)
        if descent.status.nothing_fitted:
            return PlacementFit(start, descent, tuple(ready))
        if maps_move and all(each.overlap is not None for each in pixels):
            seen = fit_maps(pixels, [view.target for view in ready], current)
            maps_move = seen != current
            if maps_move:
                current = seen
                ready = [
                    each.ready(each.table(current), np.asarray(view.target.weight))
                    for each, view in zip(pixels, ready, strict=True)
                ]
        costs.append(_cost(ready, errors, current))
        found.append(current)
        if traced is not None:
            traced(current, costs[-1])
        if progress is not None:
            progress((turn + 1) / turns)
        if costs[-2] - costs[-1] <= SETTLED * abs(costs[-1]):
            break
    # NaN must not count as the minimum.
    best = int(np.argmin(np.where(np.isnan(costs), np.inf, costs)))
    if found[best] != current:
        ready = [
            each.ready(each.table(found[best]), np.asarray(view.target.weight))
            for each, view in zip(pixels, ready, strict=True)
        ]
    status = FitStatus.CONVERGED if best > 0 else FitStatus.NO_IMPROVEMENT
    point = SearchSpace().point(found[best])
    descent = Descent(point, costs[best], costs[0], np.array(costs), status)
    return PlacementFit(found[best], descent, tuple(ready))


def ready_views(
    views: Sequence[CapturedView],
    parameters: ArtistParameters,
    errors: Sequence[RobustError],
    *,
    seed: int = 0,
) -> tuple[FitView, ...]:
    """The views with weights and visibility at `parameters`, ready for `tuner.fitting.uncertainty`.

    Nothing is fitted. `errors` and `seed` as in `fit_placement`.
    """
    ready = []
    for view, error in zip(views, errors, strict=True):
        pixels = view_pixels(view, seed=seed)
        table = pixels.table(parameters)
        ready.append(pixels.ready(table, error.weights(_image(table, parameters))))
    return tuple(ready)


_gather_tabulated = jax.jit(gather_tabulated)


def _image(table: TabulatedGather, parameters: ArtistParameters) -> Float[np.ndarray, "receivers 3"]:
    return np.asarray(_gather_tabulated(table, FalloffParameters.of(parameters)))


def _cost(
    views: Sequence[FitView], errors: Sequence[RobustError] | None, parameters: ArtistParameters
) -> float:
    """Mean over the views of the robust error, or of relMSE without the reference's noise if `errors` is
    None."""
    images = [_image(view.table, parameters) for view in views]
    if errors is None:
        targets = [view.target for view in views]
        return float(
            np.mean([weighted_squared_error(jnp.asarray(y), t) for y, t in zip(images, targets, strict=True)])
        )
    return float(np.mean([error.cost(y) for y, error in zip(images, errors, strict=True)]))
