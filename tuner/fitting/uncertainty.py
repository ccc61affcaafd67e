"""Uncertainty of a fit: an interval for each parameter, correlated parameters, and undetermined ones.

Errors of neighbouring pixels are correlated, by model error far more than by the reference's noise. So pixels
are not independent observations; tiles of the views are taken to be. With J the Jacobian of the residuals r,
H = JᵀJ, and H_b and g_b = J_bᵀ r_b those of tile b alone, leaving out tile b moves the optimum by
m_b = (H − H_b)⁻¹ g_b. For B tiles, the jackknife (Bell and McCaffrey 2002, "CR3") estimates the parameters'
covariance from these moves:

    C = (B − 1)/B Σ_b m_b m_bᵀ

It includes noise and misfit, and it does not shrink if only few tiles carry information.

The profile of a parameter is the least sum of squares over all others. The interval is where the profile
rises by less than t² C_ii/(H⁻¹)_ii. For a parabola this is Student's interval; where the loss flattens out,
as towards small α, it extends further. t is Student's quantile for the effective degrees of freedom: the
effective number of tiles (Carter, Schnepel and Steigerwald 2017), less one.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import stdtrit

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.fitting.descent import profile
from vpltune.tuner.fitting.fit_falloff import all_residuals, fit_to
from vpltune.tuner.fitting.fit_status import Descent, FitStatus
from vpltune.tuner.fitting.fit_views import TILES, FitView
from vpltune.tuner.fitting.search_space import SearchSpace
from vpltune.tuner.surrogate.tabulated_gather import gather_tabulated
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters

CONFIDENCE = 0.9
"""Confidence level of the intervals. A choice."""
OPEN_SHARE = 1.0 / 3.0
"""Share of a parameter's range, on its own scale. A wider interval means that the views do not determine the
parameter. A choice."""
PRIOR_COST = 0.01
"""Relative rise of the sum of squares up to which a parameter with a wide interval returns to the prior. A
choice."""
AT_BOUND = 1e-3
"""Distance from a bound, as a share of the range, below which a parameter counts as at it. A choice."""
REACH = np.geomspace(1e-3, 1.0, 16)
"""Distances from the optimum, on either side, at which a profile is evaluated, as shares of the cube's side.
A choice."""
TRADING = 0.8
"""Absolute correlation from which two parameters are reported to trade with each other. A choice."""


@dataclass(frozen=True)
class Interval:
    """The confidence interval of one fitted parameter."""

    value: float
    low: float
    high: float
    """Ends of the interval at confidence `CONFIDENCE`, within the parameter's range."""
    determined: bool
    """Whether the views determine the parameter. If not, `fit_with_intervals` sets `value` to the prior's."""
    trades_with: tuple[str, ...]
    """Names of the parameters that it is correlated with by `TRADING` or more."""
    at_bound: float | None = None
    """The bound of its range that the fit ran to, which makes it undetermined; else None."""


def fit_with_intervals(
    views: tuple[FitView, ...],
    prior: ArtistParameters,
    *,
    progress: Callable[[float], None] | None = None,
) -> tuple[ArtistParameters, Descent, dict[str, Interval]]:
    """Fit from `prior`, then return undetermined parameters to it one by one, refitting the others.

    A parameter is undetermined if its interval is wider than `OPEN_SHARE` and returning it costs at most
    `PRIOR_COST`, or if the fit runs to a bound of its range that the prior is not at, because a value beyond
    the range makes no sense. The intensity is an exception, because no other parameter can stand in for it:
    the width of its interval does not count, and if it runs to a bound, all parameters return to the prior.

    Args:
        views: with the weights and visibility that the fit ended with.
        prior: where the fit begins, and the values that undetermined parameters return to.
        progress: called with the share of the first fit done, in [0, 1].

    Returns:
        The parameters, the descent of the last fit, and the interval of each fitted parameter by name. There
        are no intervals if nothing could be fitted.
    """
    names = frozenset(SearchSpace().names)
    tuned, descent = fit_to(views, prior, progress=progress)
    if descent.status.nothing_fitted:
        return tuned, descent, {}
    found: dict[str, Interval] = {}
    offset = float(np.mean([view.reduced.offset for view in views]))
    known = intervals(views, tuned, names)
    trades = {name: interval.trades_with for name, interval in known.items()}
    for name in sorted(known, key=lambda name: -_width(name, known[name])):
        bound = _bound(name, tuned, prior)
        if bound is None and (name == "intensity" or _width(name, known[name]) <= OPEN_SHARE):
            continue
        if bound is not None and name == "intensity":
            every = {each: _open(known[each], prior, each, _bound(each, tuned, prior)) for each in known}
            return prior, replace(descent, status=FitStatus.NO_IMPROVEMENT), every
        without, at_prior = fit_to(views, prior, held=frozenset({name, *found}))
        if bound is None and at_prior.loss - descent.loss > PRIOR_COST * (descent.loss - offset):
            continue
        found[name] = _open(known[name], prior, name, bound)
        tuned, descent = without, at_prior
        known = intervals(views, tuned, names - frozenset(found)) | found
    # Correlations are those of the first fit, in which no parameter was held.
    return (
        tuned,
        descent,
        {
            name: replace(known[name], trades_with=trades[name])
            for name in SearchSpace().names
            if name in names
        },
    )


def open_intervals(
    views: tuple[FitView, ...], tuned: ArtistParameters, names: frozenset[str], prior: ArtistParameters
) -> dict[str, Interval]:
    """Intervals at `tuned`, which is not changed.

    A parameter counts as undetermined if its interval is wider than `OPEN_SHARE`, or if it is at a bound of
    its range that `prior` is not at. `names` are the parameters that were fitted.
    """
    known = intervals(views, tuned, names)
    bounds = {name: _bound(name, tuned, prior) for name in known}
    return {
        name: replace(
            interval,
            determined=bounds[name] is None and _width(name, interval) <= OPEN_SHARE,
            at_bound=bounds[name],
        )
        for name, interval in known.items()
    }


def intervals(
    views: tuple[FitView, ...], tuned: ArtistParameters, names: frozenset[str]
) -> dict[str, Interval]:
    """Intervals of the parameters in `names` at the optimum `tuned`; all others are taken as known.

    Each is returned as determined: callers decide.
    """
    space = SearchSpace()
    chosen = [index for index, name in enumerate(space.names) if name in names]
    slope, curvature = _tiles(views, space, jnp.asarray(space.point(tuned), jnp.float32))
    slope, curvature = slope[:, chosen], curvature[:, chosen][:, :, chosen]
    # Scale each parameter to curvature 1. Otherwise the 1e-9 in `_inverse` would make a parameter that hardly
    # changes the image look well determined.
    unit = 1.0 / np.sqrt(np.maximum(np.diag(curvature.sum(axis=0)), 1e-30))
    slope, curvature = slope * unit, curvature * np.outer(unit, unit)
    total = curvature.sum(axis=0)
    moves = np.stack([_inverse(total - own) @ g for own, g in zip(curvature, slope, strict=True)]) * unit
    spread = (len(moves) - 1) / len(moves) * (moves**2).sum(axis=0)
    inverse = _inverse(total) * np.outer(unit, unit)
    told = np.einsum("ij,bjk,ki->bi", _inverse(total), curvature, _inverse(total))
    witnesses = told.sum(axis=0) ** 2 / np.maximum((told**2).sum(axis=0), 1e-30)
    student = stdtrit(np.maximum(witnesses - 1.0, 1.0), (1.0 + CONFIDENCE) / 2.0)
    allowed = student**2 * spread / np.diag(inverse)
    ends = _profile_ends(views, space.point(tuned), chosen, allowed)
    # For the correlations only: leaving out the one informative tile moves the optimum far out of the cube.
    moves = np.clip(moves, -1.0, 1.0)
    covariance = moves.T @ moves
    deviation = np.maximum(np.sqrt(np.diag(covariance)), 1e-30)
    correlation = covariance / np.outer(deviation, deviation)
    low, high = (space.parameters(_with(space.point(tuned), chosen, end), tuned) for end in ends)
    return {
        space.names[axis]: Interval(
            float(getattr(tuned, space.names[axis])),
            float(getattr(low, space.names[axis])),
            float(getattr(high, space.names[axis])),
            True,
            tuple(
                space.names[other]
                for column, other in enumerate(chosen)
                if column != row and abs(correlation[row, column]) >= TRADING
            ),
        )
        for row, axis in enumerate(chosen)
    }


def _profile_ends(
    views: tuple[FitView, ...],
    point: Float[np.ndarray, " parameters"],
    axes: list[int],
    allowed: Float[np.ndarray, " axes"],
) -> tuple[Float[np.ndarray, " axes"], Float[np.ndarray, " axes"]]:
    """Where the profile of each axis has risen by `allowed`, below and above; the bound if it never does."""
    data, residuals = tuple(view.reduced for view in views), all_residuals(SearchSpace())
    free = np.isin(np.arange(len(point)), axes)
    ends = np.empty((2, len(axes)))
    for row, (axis, allowance) in enumerate(zip(axes, allowed, strict=True)):
        for side, sign in enumerate((-1.0, 1.0)):
            places = np.clip(point[axis] + sign * np.concatenate([[0.0], REACH]), 0.0, 1.0)
            squares = profile(residuals, data, point, axis, places, free) * len(views)
            # Rounding may make a profile dip: make it monotonic.
            rise = np.maximum.accumulate(np.maximum(squares - squares[0], 0.0))
            # Interpolate the root, which is linear for a parabola.
            ends[side, row] = (
                np.interp(np.sqrt(allowance), np.sqrt(rise) + 1e-12 * np.arange(len(rise)), places)
                if rise[-1] > allowance
                else (0.0, 1.0)[side]
            )
    return ends[0], ends[1]


def _open(interval: Interval, prior: ArtistParameters, name: str, bound: float | None) -> Interval:
    value = float(getattr(prior, name))
    return replace(interval, value=value, determined=False, at_bound=bound)


def _bound(name: str, tuned: ArtistParameters, prior: ArtistParameters) -> float | None:
    """The bound that a fit ran to; None if it is inside the range, or if the prior is at that bound too."""
    (spec,) = (spec for spec in SearchSpace().specs if spec.name == name)
    axis = SearchSpace((spec,))
    place, before = float(axis.point(tuned)[0]), float(axis.point(prior)[0])
    for wall, bound in ((0.0, spec.low), (1.0, spec.high)):
        if abs(place - wall) <= AT_BOUND < abs(before - wall):
            return float(bound)
    return None


def _width(name: str, interval: Interval) -> float:
    """Width of an interval, as a share of the parameter's range on its own scale."""
    (spec,) = (spec for spec in SearchSpace().specs if spec.name == name)
    axis = SearchSpace((spec,))
    low, high = (
        axis.point(replace(ArtistParameters(), **{name: end}))[0] for end in (interval.low, interval.high)
    )
    return float(high - low)


def _with(point: np.ndarray, axes: list[int], values: np.ndarray) -> np.ndarray:
    changed = point.copy()
    changed[axes] = values
    return changed


def _inverse(matrix: Float[np.ndarray, "n n"]) -> Float[np.ndarray, "n n"]:
    """Inverse of a positive semidefinite matrix with entries of about 1; finite even if it is singular."""
    return np.linalg.inv(matrix + 1e-9 * np.eye(len(matrix)))


def _tiles(
    views: tuple[FitView, ...], space: SearchSpace, point: Float[Array, " parameters"]
) -> tuple[Float[np.ndarray, "tiles n"], Float[np.ndarray, "tiles n n"]]:
    """Jᵀr and JᵀJ of all tiles of all views, except tiles that depend on no parameter."""
    parts = [_view_tiles(view, space, point) for view in views]
    slope, curvature = (np.concatenate([np.asarray(part[i], np.float64) for part in parts]) for i in (0, 1))
    says = np.trace(curvature, axis1=1, axis2=2) > 0.0
    return slope[says], curvature[says]


@partial(jax.jit, static_argnums=1)
def _view_tiles(
    view: FitView, space: SearchSpace, point: Float[Array, " parameters"]
) -> tuple[Float[Array, "tiles n"], Float[Array, "tiles n n"]]:
    target = view.target
    root, mean = jnp.sqrt(target.weight), (target.half_a + target.half_b) / 2.0

    def residuals(at: Array) -> tuple[Array, Array]:
        values = root * (gather_tabulated(view.table, FalloffParameters(**space.values(at))) - mean)
        return values, values

    jacobian, values = jax.jacfwd(residuals, has_aux=True)(point)
    member = jax.nn.one_hot(view.tile, TILES**2)
    exact = partial(jnp.einsum, precision=jax.lax.Precision.HIGHEST)
    return exact("rt,rcn,rc->tn", member, jacobian, values), exact(
        "rt,rcn,rcm->tnm", member, jacobian, jacobian
    )
