"""Fits where few VPLs stand, with all else, to the error that a finite number of them leaves.

Every correctly weighted density has the same mean image, so none can be learned from it. What is fitted is
the mean of the loss over several rotations of the point table (Cranley and Patterson 1976), the same ones for
every candidate (common random numbers): it holds the bias of the falloff and the variance of the placement,
and at few VPLs the best α, k and κ are others than at many.

Over (γ, η) the loss is measured, along one axis after the other, with falloff and maps fitted at every
candidate: as density shifts, VPLs cross edges and corners, and in a Cornell box one step of 0.05 in seven
goes against the smooth trend (row `density_slope_agreement` of `vpltune bench density`). Images drawn with
the start's falloff would be cheaper to judge by, but where the falloff is what is wrong all densities look
alike in them.

Every candidate but the start's own has cells (`lloyd_iterations`): at few VPLs most of the error is that a
point shines for all that lies around it, not where shadows fall.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.tuner.fitting.fit_placement import fit_placement
from vpltune.tuner.fitting.fit_status import Descent
from vpltune.tuner.fitting.fit_views import robust_errors
from vpltune.tuner.metrics.relative_squared_error import target_of, weighted_squared_error
from vpltune.tuner.metrics.robust_error import RobustError
from vpltune.tuner.surrogate.captured_view import CapturedView

ROTATIONS = 4
"""Rotations of each view, so that four views have sixteen placements. The first is none at all: what the
runtime draws with."""
HELD_OUT_ROTATIONS = 8
FEW_VPLS = 256
"""Up to this many, the fit sees several rotations and the density is fitted; beyond, one placement is as good
as any other."""
LLOYD_ITERATIONS = 8
"""Steps towards the middles of cells (rows `relaxation_…` of `vpltune bench density`)."""
DISC_FOOTPRINT = 1.0
"""α where a fit of cells begins: discs as wide as their cells. Points do best at about half of that."""
_IMPORTANCES = (0.0, 0.5, 1.0)
"""Of η, at γ = 1; one more between the middle and the better end."""
_EXPONENTS = (0.75, 0.5, 0.25, 0.0)
"""Of γ, at the best η, for as long as the loss falls."""
_TRIALS = len(_IMPORTANCES) + 3
"""As a rule: the start's own, four of η, one of γ."""
_VIEW_SHIFT = (math.sqrt(2.0) - 1.0, math.sqrt(3.0) - 1.0)
"""From a view's rotations to those of the next. R2's own step would give the same points but one."""

Rotation = tuple[float, float]
Density = tuple[float, float, int]
"""γ, η, λ."""


@dataclass(frozen=True)
class DensityTrial:
    """One candidate: its densities, and its loss with falloff and maps at their best."""

    density_exponent: float
    density_importance: float
    lloyd_iterations: int
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


def view_rotations(rotations: Sequence[Rotation], index: int) -> tuple[Rotation, ...]:
    """Those of one of several views: the first is everyone's, the others are shifted.

    Views under the same lights would else have the same VPLs, and fewer placements would be seen.
    """
    shift = index * np.array(_VIEW_SHIFT)
    moved = [tuple(float(x) for x in (np.array(rotation) + shift) % 1.0) for rotation in rotations[1:]]
    return (*rotations[:1], *moved)


def rotated_views(
    runtime: Runtime,
    views: Sequence[CapturedView],
    config: TunedConfig,
    rotations: Sequence[Rotation],
) -> tuple[CapturedView, ...]:
    """Every view drawn with `config` at its rotations, against its one reference."""
    return tuple(
        CapturedView(view.view, view.reference, captured)
        for index, view in enumerate(views)
        for captured in runtime.captures(view.view, config, view_rotations(rotations, index))
    )


def rotation_errors(
    runtime: Runtime,
    views: Sequence[CapturedView],
    config: TunedConfig,
    rotations: Sequence[Rotation],
) -> Float[np.ndarray, "views rotations"]:
    """relMSE of the runtime's own image, free of the reference's noise (`tuner.metrics`), by view and
    rotation; 0 where a view is unlit."""
    rotated = rotated_views(runtime, views, config, rotations)
    return np.array([_relmse(view) for view in rotated]).reshape(len(views), len(rotations))


def fit_density(
    runtime: Runtime,
    views: Sequence[CapturedView],
    config: TunedConfig,
    *,
    seed: int = 0,
    rotations: Sequence[Rotation] | None = None,
    robust: bool = True,
    progress: Callable[[float], None] | None = None,
) -> DensityFit:
    """Density and falloff for the config's VPL count, robust over rotations of the point table.

    Args:
        runtime: of the views' scene; draws every candidate, with a full gather.
        views: what to fit to, with references.
        config: the count, where the falloff's fit begins, and what is not fitted.
        seed: of rotations and pixels.
        rotations: what to fit to; None takes `ROTATIONS` of them.
        robust: whether to minimise the robust error of `tuner.metrics.robust_error`; else relMSE.
        progress: called with the share done, in [0, 1].
    """
    chosen = table_rotations(ROTATIONS, seed) if rotations is None else tuple(rotations)
    fits: dict[Density, tuple[ArtistParameters, Descent]] = {}
    config, start = config.with_full_gather(), config.parameters
    errors: tuple[RobustError, ...] | None = None

    def best() -> Density:
        return min(fits, key=lambda density: fits[density][1].loss)

    def measure(density: Density) -> Descent:
        nonlocal errors
        if density not in fits:
            parameters = _with(start, density)
            drawn = rotated_views(runtime, views, config.with_parameters(parameters), chosen)
            if robust and errors is None:
                # The start's own density comes first: its errors set the scale for all.
                errors = robust_errors(drawn, seed=seed)
            fit = fit_placement(drawn, parameters, errors, seed=seed)
            fits[density] = fit.parameters, fit.descent
            if progress is not None:
                progress(min(len(fits) / _TRIALS, 0.99))
        return fits[density][1]

    def result() -> DensityFit:
        trials = (DensityTrial(*density, descent.loss) for density, (_, descent) in fits.items())
        return DensityFit(*fits[best()], tuple(trials))

    # The start itself is a candidate: the result is never worse than it.
    own = measure((start.density_exponent, start.density_importance, start.lloyd_iterations))
    if own.status.nothing_fitted:
        # Nothing lit, or not finite: no density will mend it.
        return result()
    low, middle, high = _IMPORTANCES
    losses = [measure((1.0, importance, LLOYD_ITERATIONS)).loss for importance in _IMPORTANCES]
    measure((1.0, (middle + (low if losses[0] < losses[-1] else high)) / 2.0, LLOYD_ITERATIONS))
    importance = best()[1]
    for exponent in _EXPONENTS:
        measure((exponent, importance, LLOYD_ITERATIONS))
        if best() != (exponent, importance, LLOYD_ITERATIONS):
            break
    return result()


def density_document(
    runtime: Runtime,
    views: Sequence[CapturedView],
    default: TunedConfig,
    fit: DensityFit,
    seed: int,
) -> dict[str, Any]:
    """What metrics.json says of it: the trials, and both errors on rotations that were not fitted to."""
    rotations = table_rotations(HELD_OUT_ROTATIONS, seed, held_out=True)
    errors = {
        name: float(rotation_errors(runtime, views, config, rotations).mean())
        for name, config in (("default", default), ("tuned", default.with_parameters(fit.parameters)))
    }
    return {
        "vpl_count": fit.parameters.vpl_count,
        "rotations": ROTATIONS,
        "held_out_rotations": HELD_OUT_ROTATIONS,
        "held_out_relmse": errors,
        "trials": [asdict(trial) for trial in fit.trials],
    }


def with_discs(parameters: ArtistParameters, relaxation: int = LLOYD_ITERATIONS) -> ArtistParameters:
    """Cells in place of points, each a disc of its own size; parameters that have cells are as they were."""
    if parameters.lloyd_iterations > 0:
        return parameters
    return replace(parameters, lloyd_iterations=relaxation, falloff_footprint=DISC_FOOTPRINT)


def _with(parameters: ArtistParameters, density: Density) -> ArtistParameters:
    exponent, importance, relaxation = density
    if relaxation > 0:
        parameters = with_discs(parameters)
    return replace(
        parameters,
        density_exponent=exponent,
        density_importance=importance,
        lloyd_iterations=relaxation,
    )


def _relmse(view: CapturedView) -> float:
    halves = (half[view.valid] for half in (view.reference.irradiance_a, view.reference.irradiance_b))
    image = jnp.asarray(view.captured.indirect_irradiance[view.valid])
    return float(weighted_squared_error(image, target_of(*halves)))
