"""Looks for better parameters on the fitted views; `tuner.evaluation.guard` decides whether they are."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.tuner.evaluation.prepare_scene import PreparedScene
from vpltune.tuner.fitting.choose_placement import choose_placement
from vpltune.tuner.fitting.fit_density import density_document, fit_density, with_discs
from vpltune.tuner.fitting.fit_placement import fit_placement, ready_views
from vpltune.tuner.fitting.fit_status import Descent
from vpltune.tuner.fitting.fit_views import robust_errors
from vpltune.tuner.fitting.search_space import SearchSpace
from vpltune.tuner.fitting.uncertainty import Interval, fit_with_intervals, open_intervals
from vpltune.tuner.frame_time.fit_budget import BudgetOptions, fit_to_budget
from vpltune.tuner.surrogate.captured_view import CapturedView, capture_views


@dataclass(frozen=True, eq=False)
class Search:
    """What a search found."""

    base: ArtistParameters
    """The tuned placement with the falloff and visibility that its fit began with."""
    tuned: ArtistParameters
    quality: Quality
    """The start's, or what meets the budget."""
    descent: Descent
    known: dict[str, Interval]
    """What is known of each falloff parameter."""
    views: tuple[CapturedView, ...]
    """The fitted views that light reaches, captured with the tuned placement."""
    document: dict[str, Any] = field(default_factory=dict)
    """What metrics.json gains."""


def search(
    prepared: PreparedScene,
    start: TunedConfig,
    output: Path,
    *,
    density: bool,
    budget: BudgetOptions | None,
    seed: int,
    progress: Callable[[float], None],
) -> Search:
    """The best that the fitted views know of.

    Args:
        prepared: some fitted view of it is lit.
        start: without a prior.
        output: where a budget's front is written.
        density: fit to several rotations of the point table, for few VPLs.
        budget: fit the count and how the frame is drawn to a frame time.
    """
    views = tuple(view for view in prepared.views if view.view.split == "fitted" and view.lit)
    if budget is not None:
        met, descent, found = fit_to_budget(prepared, start, budget, output, seed=seed, progress=progress)
        start = replace(start, quality=met.quality)
        return _recaptured(prepared, views, start, met.parameters, descent, found, seed)
    if density:
        fit = fit_density(prepared.runtime, views, start, seed=seed, progress=progress)
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
    """A search whose VPLs ended elsewhere than they began: the views once more, and the intervals there."""
    base = replace(
        start.parameters,
        vpl_count=tuned.vpl_count,
        density_exponent=tuned.density_exponent,
        density_importance=tuned.density_importance,
    )
    if tuned.lloyd_iterations > 0:
        # Discs begin at α = 1, whatever the start's points had; a start with discs keeps its α.
        base = replace(with_discs(base), lloyd_iterations=tuned.lloyd_iterations)
    captured = capture_views(
        prepared.runtime,
        start.with_parameters(tuned),
        tuple(view.view for view in views),
        tuple(view.reference for view in views),
    )
    if descent.status.nothing_fitted:
        return Search(base, tuned, start.quality, descent, {}, captured, found)
    # One rotation a view: several of one view err together, and would count as independent witnesses.
    ready = ready_views(captured, tuned, robust_errors(captured, seed=seed), seed=seed)
    names = frozenset(SearchSpace().names)
    known = open_intervals(ready, tuned, names, base)
    return Search(base, tuned, start.quality, descent, known, captured, found)
