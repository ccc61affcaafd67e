"""Searches for parameters on the fitted views; `tuner.evaluation.guard` decides whether they are better."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.tuner.evaluation.prepare_scene import PreparedScene
from vpltune.tuner.fitting.choose_placement import choose_placement
from vpltune.tuner.fitting.fit_density import FEW_VPLS, density_document, fit_density, with_discs
from vpltune.tuner.fitting.fit_own_loss import Loss, fit_own_loss
from vpltune.tuner.fitting.fit_placement import Trace, fit_placement, ready_views
from vpltune.tuner.fitting.fit_status import Descent
from vpltune.tuner.fitting.fit_views import robust_errors
from vpltune.tuner.fitting.search_space import SearchSpace
from vpltune.tuner.fitting.uncertainty import Interval, fit_with_intervals, open_intervals
from vpltune.tuner.frame_time.fit_budget import BudgetOptions, Front, fit_to_budget
from vpltune.tuner.surrogate.captured_view import CapturedView, capture_views


@dataclass(frozen=True, eq=False)
class Search:
    """The result of a search."""

    base: ArtistParameters
    """The tuned placement with the falloff and visibility that its fit started from."""
    tuned: ArtistParameters
    quality: Quality
    """The start's quality, or the one that meets the budget."""
    descent: Descent
    known: dict[str, Interval]
    """The interval of each falloff parameter; empty if nothing could be fitted."""
    views: tuple[CapturedView, ...]
    """The lit fitted views, captured with the tuned placement."""
    document: dict[str, Any] = field(default_factory=dict)
    """Further keys of metrics.json: `density`, `budget` and `pareto`, or `placements`."""
    front: Front | None = None
    """What `budget` asked for; its files are part of the fit's."""


def search(
    prepared: PreparedScene,
    start: TunedConfig,
    *,
    budget: BudgetOptions | None,
    loss: Loss | None,
    seed: int,
    progress: Callable[[float], None],
    traced: Trace | None = None,
) -> Search:
    """Search for the best parameters on the fitted views.

    Args:
        prepared: the scene; at least one of its fitted views is lit.
        start: where the search begins; has no prior.
        budget: pick VPL count and quality settings that meet a frame time; overrides the start's.
        loss: replaces the built-in objective (`tuner.fitting.fit_own_loss`); excludes `budget`.
        seed: selects pixels and rotations.
        progress: called with the share done, in [0, 1].
        traced: called with parameters that were tried and their cost; not within a budget.

    Raises:
        InputError: no frame meets the budget, or `loss` is not one finite number.
    """
    views = tuple(view for view in prepared.views if view.view.split == "fitted" and view.lit)
    if loss is not None:
        tuned, descent = fit_own_loss(views, start.parameters, loss, seed=seed, progress=progress)
        return Search(start.parameters, tuned, start.quality, descent, {}, views)
    if budget is not None:
        met, descent, found, front = fit_to_budget(prepared, start, budget, seed=seed, progress=progress)
        start = replace(start, quality=met.quality)
        made = _recaptured(prepared, views, start, met.parameters, descent, found, seed)
        return replace(made, front=front)
    if start.parameters.vpl_count <= FEW_VPLS:
        fit = fit_density(prepared.runtime, views, start, seed=seed, progress=progress, traced=traced)
        found = {"density": density_document(prepared.runtime, views, start, fit, seed)}
        return _recaptured(prepared, views, start, fit.parameters, fit.descent, found, seed)
    errors = robust_errors(views, seed=seed)
    placed = choose_placement(
        prepared.runtime,
        views,
        start,
        errors,
        seed=seed,
        progress=lambda share: progress(0.6 * share),
    )
    fit = fit_placement(
        placed.views,
        placed.parameters,
        errors,
        seed=seed,
        progress=lambda share: progress(0.6 + 0.3 * share),
        traced=traced,
    )
    prior = replace(
        placed.parameters,
        visibility_bias=fit.parameters.visibility_bias,
        visibility_softness=fit.parameters.visibility_softness,
    )
    tuned, _, known = fit_with_intervals(fit.views, prior)
    progress(1.0)
    return Search(
        placed.parameters,
        tuned,
        start.quality,
        fit.descent,
        known,
        placed.views,
        {"placements": placed.costs},
    )


def _recaptured(
    prepared: PreparedScene,
    views: tuple[CapturedView, ...],
    start: TunedConfig,
    tuned: ArtistParameters,
    descent: Descent,
    found: dict[str, Any],
    seed: int,
) -> Search:
    """Finish a search that moved the VPLs: capture the views again, and compute the intervals there."""
    base = replace(
        start.parameters,
        vpl_count=tuned.vpl_count,
        density_exponent=tuned.density_exponent,
        density_importance=tuned.density_importance,
    )
    if tuned.lloyd_iterations > 0:
        # Discs begin at α = 1 if the start has points; a start with discs keeps its α.
        base = replace(with_discs(base), lloyd_iterations=tuned.lloyd_iterations)
    captured = capture_views(
        prepared.runtime,
        start.with_parameters(tuned),
        tuple(view.view for view in views),
        tuple(view.reference for view in views),
    )
    if descent.status.nothing_fitted:
        return Search(base, tuned, start.quality, descent, {}, captured, found)
    # One rotation for each view: errors of several rotations of a view are correlated, and their tiles would
    # count as independent.
    ready = ready_views(captured, tuned, robust_errors(captured, seed=seed), seed=seed)
    names = frozenset(SearchSpace().names)
    known = open_intervals(ready, tuned, names, base)
    return Search(base, tuned, start.quality, descent, known, captured, found)
