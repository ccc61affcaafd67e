"""Chooses the placement density of many VPLs by images that the runtime draws.

With few VPLs the best density depends on falloff and maps, so `tuner.fitting.fit_density` fits all of them
together. With many, the errors of placements differ by factors, and the falloff hardly changes them. So each
placement is drawn with the start's falloff, with α = 1 where discs replace points, and judged by the robust
error of its images. Two views screen all placements, and the best one is drawn in the others too.

All placements but the start's own are clustered discs, up to `LARGEST_DISC_COUNT` VPLs; more are points.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vpltune.renderer.config.artist_parameters import LARGEST_DISC_COUNT, ArtistParameters, placement
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.tuner.fitting.fit_density import with_discs
from vpltune.tuner.fitting.fit_views import drawn_cost
from vpltune.tuner.metrics.robust_error import RobustError
from vpltune.tuner.surrogate.captured_view import CapturedView, capture_views

LLOYD_ITERATIONS = 2
"""Lloyd iterations with many VPLs. A choice, made on development scenes: eight gave about the same error and
took longer."""
IMPORTANCES = (0.0, 0.25, 0.5, 0.75, 1.0)
"""η of the placements that are tried besides the start's own, at γ = 1. A choice."""
SCREENED = 2
"""Views in which all placements are drawn. A choice."""


@dataclass(frozen=True, eq=False)
class ChosenPlacement:
    """The placement with the least error, and its images."""

    parameters: ArtistParameters
    views: tuple[CapturedView, ...]
    """Every view, captured with `parameters`."""
    costs: dict[str, float]
    """Cost of each placement relative to the start's, a geometric mean over the screened views, by
    `placement_name`."""


def choose_placement(
    runtime: Runtime,
    views: Sequence[CapturedView],
    config: TunedConfig,
    errors: Sequence[RobustError],
    *,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> ChosenPlacement:
    """Choose between the start's own placement and clustered disc lights with increasing importance η.

    With more VPLs than can be clustered, the alternatives are points too.

    Args:
        runtime: draws the views' scene.
        views: captured with `config`; indirect light reaches each of them.
        config: holds the start's parameters.
        errors: the robust error of each view, from `robust_errors` with the same seed.
        seed: selects the pixels of each view.
        progress: called with the share done, in [0, 1].
    """
    start = config.parameters
    tried = _placements(start)
    screened = slice(0, SCREENED)
    own = _costs(views[screened], errors[screened], seed)
    drawn, costs = {}, {placement_name(start): 1.0}
    for index, parameters in enumerate(tried):
        drawn[parameters] = _captured(runtime, config.with_parameters(parameters), views[screened])
        ratios = _costs(drawn[parameters], errors[screened], seed) / np.maximum(own, 1e-30)
        # The geometric mean: half the error in one view makes up for twice the error in another.
        costs[placement_name(parameters)] = float(np.exp(np.mean(np.log(np.maximum(ratios, 1e-30)))))
        if progress is not None:
            progress((index + 1) / (len(tried) + 1))
    best = min(drawn, key=lambda each: costs[placement_name(each)], default=start)
    if best == start or costs[placement_name(best)] >= 1.0:
        return ChosenPlacement(start, tuple(views), costs)
    rest = _captured(runtime, config.with_parameters(best), views[SCREENED:])
    return ChosenPlacement(best, (*drawn[best], *rest), costs)


def placement_name(parameters: ArtistParameters) -> str:
    """Name of a placement in metrics.json, for example "discs λ=2 γ=1 η=0.5"."""
    form = f"discs λ={parameters.lloyd_iterations}" if parameters.vpls_are_discs else "points"
    return f"{form} γ={parameters.density_exponent:g} η={parameters.density_importance:g}"


def _placements(start: ArtistParameters) -> list[ArtistParameters]:
    """The alternatives to the start's placement; more VPLs than can be clustered stay points."""
    clustered = with_discs(start, LLOYD_ITERATIONS) if start.vpl_count <= LARGEST_DISC_COUNT else start
    tried = [
        replace(clustered, density_exponent=1.0, density_importance=importance) for importance in IMPORTANCES
    ]
    return [each for each in tried if placement(each) != placement(start)]


def _captured(
    runtime: Runtime, config: TunedConfig, views: Sequence[CapturedView]
) -> tuple[CapturedView, ...]:
    return capture_views(runtime, config, tuple(v.view for v in views), tuple(v.reference for v in views))


def _costs(views: Sequence[CapturedView], errors: Sequence[RobustError], seed: int) -> np.ndarray:
    return np.array([drawn_cost(view, error, seed=seed) for view, error in zip(views, errors, strict=True)])
