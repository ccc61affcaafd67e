"""Fits where few VPLs stand, with all else, to the error that a finite number of them leaves.

Every correctly weighted density has the same mean picture, so none can be learned from it. What is fitted is
the mean of the loss over several rotations of the point table (Cranley and Patterson 1976), the same ones for
every candidate (common random numbers): it holds the bias of the falloff and the variance of the placement,
and at few VPLs the best α, k and κ are others than at many.

Over (γ, η) the loss is measured in the runtime, along one axis after the other, each candidate's picture at
its best k: as density shifts, VPLs cross edges and corners, and in a Cornell box one step of 0.05 in seven
goes against the smooth trend (row `density_slope_agreement` of `vpltune bench density`). In four rooms this
ends where a grid of nine and the minimum of a quadratic through it did, in half the time, but in one with a
loss 3 % higher (relMSE of held-out rotations: 2 %).

Falloff and maps are fitted once, at the best density. Fitted at every candidate, they chose the same one in
eight of nine scenes, for twice the time, and in the ninth one with 2 % less loss.

Every candidate but the start's own has cells (`density_relaxation`): at few VPLs most of the error is that a
point shines for all that lies around it, not where shadows fall.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from renderer.artist_parameters import ArtistParameters
from renderer.runtime import Runtime
from tuner.captured_view import CapturedView
from tuner.fit_falloff import fit_falloff
from tuner.fit_status import Descent
from tuner.fit_visibility import fit_falloff_and_visibility
from tuner.losses.relative_squared_error import DARK_SHARE, EVEN_SHARE, target_of
from tuner.search_space import held_for

ROTATIONS = 8
"""Of each view. The first is none at all, which is the one that the runtime draws with."""
HELD_OUT_ROTATIONS = 8
FEW_VPLS = 256
"""Up to this many, the fit sees several rotations and the density is fitted; beyond, one placement is as good
as any other."""
RELAXATION = 8
"""Steps towards the middles of cells (rows `relaxation_…` of `vpltune bench density`)."""
CELL_FOOTPRINT = 1.0
"""α where a fit of cells begins: discs as wide as their cells. Points do best at about half of that."""
_IMPORTANCES = (0.0, 0.5, 1.0)
"""Of η, at γ = 1; more where their parabola is least, in steps of a tenth."""
_EXPONENTS = (0.75, 0.5, 0.25, 0.0)
"""Of γ, at the best η, for as long as the loss falls."""
_TRIALS = 6
"""As a rule: the start's own, three of η, one at their parabola's minimum, one of γ."""

Rotation = tuple[float, float]
Density = tuple[float, float, int]
"""γ, η, λ."""


@dataclass(frozen=True)
class DensityTrial:
    """One candidate: its densities, and the loss of what the runtime draws with it, at the best k."""

    density_exponent: float
    density_importance: float
    density_relaxation: int
    loss: float


@dataclass(frozen=True, eq=False)
class DensityFit:
    """The best candidate met, and all that were measured."""

    parameters: ArtistParameters
    descent: Descent
    trials: tuple[DensityTrial, ...]


def table_rotations(count: int, seed: int, *, held_out: bool = False) -> tuple[Rotation, ...]:
    """`count` rotations of the point table; those that are held out share none with the others."""
    random = np.random.default_rng([seed, int(held_out)])
    drawn = [tuple(float(x) for x in pair) for pair in random.random((count, 2))]
    return tuple(drawn) if held_out else ((0.0, 0.0), *drawn[1:])


def rotated_views(
    runtime: Runtime,
    views: Sequence[CapturedView],
    parameters: ArtistParameters,
    rotations: Sequence[Rotation],
) -> tuple[CapturedView, ...]:
    """Every view drawn with `parameters` at every rotation, against its one reference."""
    runtime.parameters = parameters
    return tuple(
        CapturedView(view.view, view.reference, runtime.capture(view.view, rotation))
        for view in views
        for rotation in rotations
    )


def rotation_errors(
    runtime: Runtime,
    views: Sequence[CapturedView],
    parameters: ArtistParameters,
    rotations: Sequence[Rotation],
) -> Float[np.ndarray, "views rotations"]:
    """relMSE of the runtime's own picture, free of the reference's noise, by view and rotation."""
    rotated = rotated_views(runtime, views, parameters, rotations)
    return np.array([_relmse(view) for view in rotated]).reshape(len(views), len(rotations))


def fit_density(
    runtime: Runtime,
    views: Sequence[CapturedView],
    start: ArtistParameters,
    *,
    seed: int = 0,
    rotations: Sequence[Rotation] | None = None,
    even_share: float = EVEN_SHARE,
    progress: Callable[[float], None] | None = None,
) -> DensityFit:
    """Density and falloff for `start.vpl_count` VPLs, robust over rotations of the point table.

    Args:
        runtime: of the views' scene; draws every candidate. Its parameters are a candidate's afterwards.
        views: what to fit to, with references.
        start: the count, where the falloff's fit begins, and what is not fitted.
        seed: of rotations and pixels.
        rotations: what to fit to; None takes `ROTATIONS` of them.
        even_share: weight of plain squared error beside relMSE, see `tuner.losses`.
        progress: called with the share done, in [0, 1].
    """
    chosen = table_rotations(ROTATIONS, seed) if rotations is None else tuple(rotations)
    losses: dict[Density, float] = {}
    captured: tuple[CapturedView, ...] = ()

    def best() -> Density:
        return min(losses, key=lambda density: losses[density])

    def measure(density: Density) -> float:
        nonlocal captured
        if density not in losses:
            drawn = rotated_views(runtime, views, _with(start, density), chosen)
            losses[density] = drawn_loss(drawn, even_share)
            captured = drawn if best() == density else captured
            if progress is not None:
                progress(min(len(losses) / (_TRIALS + 1), 1.0))
        return losses[density]

    def fitted(density: Density) -> DensityFit:
        parameters, held = _with(start, density), held_for(runtime.visibility)
        if runtime.visibility == "maps":
            result = fit_falloff_and_visibility(captured, parameters, seed=seed, even_share=even_share)
        else:
            result = fit_falloff(captured, parameters, seed=seed, held=held, even_share=even_share)
        return DensityFit(*result, tuple(DensityTrial(*tried, loss) for tried, loss in losses.items()))

    # The start itself is a candidate: the result is never worse than it.
    first = (start.density_exponent, start.density_importance, start.density_relaxation)
    if not math.isfinite(measure(first)):
        # Nothing lit, or not finite: no density will mend it, and the fit says which.
        return fitted(first)
    row = [measure((1.0, importance, RELAXATION)) for importance in _IMPORTANCES]
    importance = round(parabola_minimum(_IMPORTANCES, row), 1)
    measure((1.0, importance, RELAXATION))
    importance = min((*_IMPORTANCES, importance), key=lambda place: losses[1.0, place, RELAXATION])
    for exponent in _EXPONENTS:
        measure((exponent, importance, RELAXATION))
        if best() != (exponent, importance, RELAXATION):
            break
    return fitted(best())


def drawn_loss(drawn: Sequence[CapturedView], even_share: float) -> float:
    """The fit's loss of pictures as they were drawn, but for k, which is at its best for all of them.

    Args:
        drawn: views captured with a candidate's parameters.
        even_share: weight of plain squared error beside relMSE, see `tuner.losses`.

    Returns:
        The mean over views, without unit; not a number where none is lit.
    """
    terms = []
    for view in drawn:
        picture = view.captured.indirect_irradiance[view.valid].astype(np.float64)
        halves = (half[view.valid] for half in (view.reference.irradiance_a, view.reference.irradiance_b))
        target = target_of(*halves, even_share)
        half_a, half_b, weight = (
            np.asarray(x, np.float64) for x in (target.half_a, target.half_b, target.weight)
        )
        terms.append(
            (
                (weight * picture**2).sum(),
                (weight * picture * (half_a + half_b)).sum(),
                (weight * half_a * half_b).sum(),
            )
        )
    square, product, constant = np.mean(terms, axis=0)
    # Of square · k² - product · k + constant.
    return float(constant - product**2 / (4.0 * square)) if square > 0.0 else math.nan


def parabola_minimum(places: Sequence[float], losses: Sequence[float]) -> float:
    """Where the parabola through the logarithms of three losses is least between the outer places."""
    # A fit without the reference's noise may end at or below 0; the floor keeps the logarithm finite.
    values = np.array(losses)
    logs = np.log(np.maximum(values, 1e-3 * np.abs(values).max() + 1e-30))
    curvature, slope, _ = np.polyfit(places, logs, 2)
    if curvature <= 0.0:
        return float(places[np.argmin(logs)])
    return float(np.clip(-slope / (2.0 * curvature), min(places), max(places)))


def density_document(
    runtime: Runtime,
    views: Sequence[CapturedView],
    default: ArtistParameters,
    fit: DensityFit,
    seed: int,
) -> dict[str, Any]:
    """What metrics.json says of it: the trials, and both errors on rotations that were not fitted to."""
    rotations = table_rotations(HELD_OUT_ROTATIONS, seed, held_out=True)
    errors = {
        name: float(rotation_errors(runtime, views, parameters, rotations).mean())
        for name, parameters in (("default", default), ("tuned", fit.parameters))
    }
    return {
        "vpl_count": fit.parameters.vpl_count,
        "rotations": ROTATIONS,
        "held_out_rotations": HELD_OUT_ROTATIONS,
        "held_out_relmse": errors,
        "trials": [asdict(trial) for trial in fit.trials],
    }


def with_cells(parameters: ArtistParameters) -> ArtistParameters:
    """Cells in place of points, each a disc of its own size; parameters that have cells are as they were."""
    if parameters.density_relaxation > 0:
        return parameters
    return replace(parameters, density_relaxation=RELAXATION, falloff_footprint=CELL_FOOTPRINT)


def _with(parameters: ArtistParameters, density: Density) -> ArtistParameters:
    exponent, importance, relaxation = density
    if relaxation > 0:
        parameters = with_cells(parameters)
    return replace(
        parameters,
        density_exponent=exponent,
        density_importance=importance,
        density_relaxation=relaxation,
    )


def _relmse(view: CapturedView) -> float:
    """mean((y − a)(y − b) / (r² + 0.01·mean(r)²)): relMSE without the noise of the reference's halves."""
    y = view.captured.indirect_irradiance[view.valid].astype(np.float64)
    a, b = (half[view.valid] for half in (view.reference.irradiance_a, view.reference.irradiance_b))
    r = (a.astype(np.float64) + b) / 2.0
    denominator = r**2 + DARK_SHARE * r.mean() ** 2 if r.size else r
    if not denominator.any():
        return math.nan
    return float(np.mean((y - a) * (y - b) / denominator))
