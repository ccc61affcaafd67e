"""How sure a fit is: an interval for each parameter, what it trades with, and what the scene leaves open.

Neighbouring pixels err together, by what the model leaves out far more than by the reference's noise, so
pixels cannot be counted as witnesses: tiles of the views can. With J the Jacobian of the residuals r,
H = JᵀJ, and H_b, g_b = J_bᵀ r_b those of tile b alone, leaving a tile out moves the optimum by
(H − H_b)⁻¹ g_b. The jackknife (Bell and McCaffrey 2002, "CR3") takes the covariance of the parameters from
these moves,

    C = (B − 1)/B Σ_b m_b m_bᵀ

which holds noise and misfit and does not shrink where few tiles tell all. The interval of a parameter is
where its profile, the least sum of squares with all others at their best, rises by less than t² C/H⁻¹: for a
parabola that is Student's interval, and where the loss flattens out, as towards small α, it goes on. t has as
many degrees of freedom as tiles tell about the parameter (Carter, Schnepel and Steigerwald 2017), less one.
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
OPEN_SHARE = 1.0 / 3.0
"""Of a parameter's range, on its own scale: an interval that is wider says nothing."""
PRIOR_COST = 0.01
"""Of the sum of squares, which a parameter may cost that goes back to the prior."""
AT_BOUND = 1e-3
"""Share of the cube's side: nearer to its wall, a parameter is at its bound."""
REACH = np.geomspace(1e-3, 1.0, 16)
"""Of the cube's side: how far from the optimum a profile is asked, on either side."""
TRADING = 0.8
"""Correlation from which on two parameters are said to trade with each other."""


@dataclass(frozen=True)
class Interval:
    """What is known of one parameter after a fit."""

    value: float
    low: float
    high: float
    """The interval that holds the truth with CONFIDENCE, within the parameter's range."""
    determined: bool
    """False where the views do not tell, and `value` is the prior's."""
    trades_with: tuple[str, ...]
    """Parameters that could move along with it at little cost."""
    at_bound: float | None = None
    """The bound of its range that the fit ran to, where `value` is the prior's for that reason."""


def fit_with_intervals(
    views: tuple[FitView, ...],
    prior: ArtistParameters,
    *,
    progress: Callable[[float], None] | None = None,
) -> tuple[ArtistParameters, Descent, dict[str, Interval]]:
    """Fit from `prior`, and go back to it in what the views leave open, one by one, refitting the rest.

    A parameter is left open where its interval is wide and going back costs next to nothing, or where the fit
    runs to a bound of its range that the prior is not at: what lies beyond the range cannot be meant. Where
    that is the intensity, which no other parameter can stand in for, all of them go back to the prior.
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
    # With whom a parameter trades is asked of all of them together, before any was held.
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
    """Intervals at `tuned`, which stays as it is; a parameter that is left open, or at a bound of its range
    that `prior` is not at, is not determined."""
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
    """Intervals of the parameters in `names` at the optimum `tuned`, all others taken to be known."""
    space = SearchSpace()
    chosen = [index for index, name in enumerate(space.names) if name in names]
    slope, curvature = _tiles(views, space, jnp.asarray(space.point(tuned), jnp.float32))
    slope, curvature = slope[:, chosen], curvature[:, chosen][:, :, chosen]
    # In units in which every parameter has curvature 1: one that hardly shows is not one that is known.
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
    # For the correlations alone: a tile without which nothing is known moves the optimum out of the cube.
    moves = np.clip(moves, -1.0, 1.0)
    covariance = moves.T @ moves
    deviation = np.maximum(np.sqrt(np.diag(covariance)), 1e-30)
    correlation = covariance / np.outer(deviation, deviation)
    ends = [space.parameters(_with(space.point(tuned), chosen, end), tuned) for end in ends]
    return {
        space.names[axis]: Interval(
            float(getattr(tuned, space.names[axis])),
            *(float(getattr(end, space.names[axis])) for end in ends),
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
    """Where the profile of each axis has risen by what is allowed; the cube's wall where it never does."""
    data, residuals = tuple(view.reduced for view in views), all_residuals(SearchSpace())
    free = np.isin(np.arange(len(point)), axes)
    ends = np.empty((2, len(axes)))
    for row, (axis, allowance) in enumerate(zip(axes, allowed, strict=True)):
        for side, sign in enumerate((-1.0, 1.0)):
            places = np.clip(point[axis] + sign * np.concatenate([[0.0], REACH]), 0.0, 1.0)
            squares = profile(residuals, data, point, axis, places, free) * len(views)
            # Standing still is not beyond what stood still before: a profile of rounded sums may dip.
            rise = np.maximum.accumulate(np.maximum(squares - squares[0], 0.0))
            # Roots of rises, which for a parabola are straight lines.
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
    """The bound that a fit ran to; None where it is inside the range, or the prior is at that bound
    itself."""
    (spec,) = (spec for spec in SearchSpace().specs if spec.name == name)
    axis = SearchSpace((spec,))
    place, before = float(axis.point(tuned)[0]), float(axis.point(prior)[0])
    for wall, bound in ((0.0, spec.low), (1.0, spec.high)):
        if abs(place - wall) <= AT_BOUND < abs(before - wall):
            return float(bound)
    return None


def _width(name: str, interval: Interval) -> float:
    """Of an interval, in shares of the parameter's range on its own scale."""
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
    """Of a positive matrix of size about 1, finite where there is a direction in which it is zero."""
    return np.linalg.inv(matrix + 1e-9 * np.eye(len(matrix)))


def _tiles(
    views: tuple[FitView, ...], space: SearchSpace, point: Float[Array, " parameters"]
) -> tuple[Float[np.ndarray, "tiles n"], Float[np.ndarray, "tiles n n"]]:
    """Jᵀr and JᵀJ of every tile of every view that has something to say."""
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
