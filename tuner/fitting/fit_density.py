"""Fits the placement density of few VPLs, together with falloff and visibility maps.

Every correctly weighted density has the same expected image, so that image cannot tell densities apart. The
fit minimises the mean loss over several rotations of the point table (Cranley and Patterson 1976), the same
ones for every candidate (common random numbers). This mean includes the bias of the falloff and the variance
of the placement. With few VPLs the best α, k and κ are not those of many.

The loss over (γ, η) is searched along one axis after the other, with falloff and maps refitted for every
candidate. No gradient is used: as the density shifts, VPLs cross edges and corners, and in a Cornell box one
step of 0.05 in seven goes against the smooth trend (row `density_slope_agreement`, `vpltune bench density`).
It would be cheaper to judge images drawn with the start's falloff, but where that falloff is wrong, all
densities look alike.

Every candidate except the start uses clustered disc lights (`lloyd_iterations`): with few VPLs, the point
approximation dominates the error, not visibility.
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
from vpltune.tuner.fitting.fit_placement import Trace, fit_placement
from vpltune.tuner.fitting.fit_status import Descent
from vpltune.tuner.fitting.fit_views import robust_errors
from vpltune.tuner.metrics.relative_squared_error import target_of, weighted_squared_error
from vpltune.tuner.metrics.robust_error import RobustError
from vpltune.tuner.surrogate.captured_view import CapturedView

ROTATIONS = 4
"""Rotations of each view: four views then give sixteen placements. The first one is the identity, which the
runtime draws with. A choice."""
HELD_OUT_ROTATIONS = 8
"""Rotations on which a fit is measured, and which it does not see. A choice."""
FEW_VPLS = 256
"""Up to this many VPLs, the fit sees several rotations and fits the density. With more, one rotation is as
good as another. A choice."""
LLOYD_ITERATIONS = 8
"""Lloyd iterations of the candidates (rows `relaxation_…` of `vpltune bench density`). A choice."""
DISC_FOOTPRINT = 1.0
"""α at which a fit of clustered disc lights begins: each disc is as wide as its cluster. Points do best at
about half of that."""
_IMPORTANCES = (0.0, 0.5, 1.0)
"""η of the candidates at γ = 1; one more lies between the middle one and the better end. A choice."""
_EXPONENTS = (0.75, 0.5, 0.25, 0.0)
"""γ of the candidates at the best η, tried in this order while the loss falls. A choice."""
_TRIALS = len(_IMPORTANCES) + 3
"""Typical number of candidates, for the progress: the start, four of η and one of γ."""
_VIEW_SHIFT = (math.sqrt(2.0) - 1.0, math.sqrt(3.0) - 1.0)
"""Shift of the rotations from one view to the next. A choice, but not the step of the R2 sequence: that would
give the same points, all but one."""

Rotation = tuple[float, float]
"""Shift of the point table on its torus, in [0, 1)²."""
Density = tuple[float, float, int]
"""γ, η and λ."""


@dataclass(frozen=True)
class DensityTrial:
    """One candidate: its placement parameters, and its loss after falloff and maps were fitted."""

    density_exponent: float
    density_importance: float
    lloyd_iterations: int
    loss: float


@dataclass(frozen=True, eq=False)
class DensityFit:
    """The best candidate, and the losses of all."""

    parameters: ArtistParameters
    descent: Descent
    """That of the best candidate's falloff."""
    trials: tuple[DensityTrial, ...]
    """All candidates, the start first."""


def table_rotations(count: int, seed: int, *, held_out: bool = False) -> tuple[Rotation, ...]:
    """`count` random rotations of the point table.

    The first one is the identity, unless `held_out`. Held-out rotations have a random stream of their own.
    """
    random = np.random.default_rng([seed, int(held_out)])
    drawn = [(float(u), float(v)) for u, v in random.random((count, 2))]
    return tuple(drawn) if held_out else ((0.0, 0.0), *drawn[1:])


def view_rotations(rotations: Sequence[Rotation], index: int) -> tuple[Rotation, ...]:
    """The rotations of view number `index`: the first is unchanged, the others are shifted.

    Otherwise views under the same lights would have the same VPLs, and a fit would see fewer placements.
    """
    along, across = (index * shift for shift in _VIEW_SHIFT)
    moved = [((u + along) % 1.0, (v + across) % 1.0) for u, v in rotations[1:]]
    return (*rotations[:1], *moved)


def rotated_views(
    runtime: Runtime,
    views: Sequence[CapturedView],
    config: TunedConfig,
    rotations: Sequence[Rotation],
) -> tuple[CapturedView, ...]:
    """Capture every view at its rotations, view by view; all captures of a view share its reference."""
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
    """relMSE of the runtime's images, without the reference's noise; 0 if a view is unlit."""
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
    traced: Trace | None = None,
) -> DensityFit:
    """Fit density, falloff and visibility maps for the config's VPL count.

    Args:
        runtime: draws every candidate, with a full gather.
        views: views of the runtime's scene, with their references.
        config: the VPL count, where the fit of the falloff begins, and everything that is not fitted.
        seed: selects rotations and pixels.
        rotations: rotations to fit to; None takes `ROTATIONS` of them.
        robust: minimise the robust error (`tuner.metrics.robust_error`) if True, else relMSE.
        progress: called with the share done, in [0, 1].
        traced: as in `fit_placement`, for each candidate.

    Returns:
        The candidate with the least loss, which is the start if no other is better.
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
                # The start is measured first: its images set the scale of the robust error for all.
                errors = robust_errors(drawn, seed=seed)
            fit = fit_placement(drawn, parameters, errors, seed=seed, traced=traced)
            fits[density] = fit.parameters, fit.descent
            if progress is not None:
                progress(min(len(fits) / _TRIALS, 0.99))
        return fits[density][1]

    def result() -> DensityFit:
        trials = (DensityTrial(*density, descent.loss) for density, (_, descent) in fits.items())
        return DensityFit(*fits[best()], tuple(trials))

    # The start is a candidate, so the result is never worse.
    own = measure((start.density_exponent, start.density_importance, start.lloyd_iterations))
    if own.status.nothing_fitted:
        # Nothing is lit, or the loss is not finite: no density changes that.
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
    """The key `density` of metrics.json: trials, and relMSE of default and tuned on held-out rotations."""
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
    """`parameters` with clustered disc lights in place of points, at α = `DISC_FOOTPRINT`.

    Parameters that have discs already are returned unchanged. `relaxation` is the number of Lloyd iterations.
    """
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
