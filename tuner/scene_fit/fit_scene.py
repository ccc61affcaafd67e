"""`vpltune fit`: fits a scene, judges the result on validation views, and writes config and metrics."""

import importlib.metadata
import platform
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vpltune.renderer.config.artist_parameters import ArtistParameters, placement
from vpltune.renderer.config.tuned_config import FitNote, TunedConfig, write_config
from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import require_writable, write_text_whole, written_together
from vpltune.renderer.files.image_file import write_png
from vpltune.renderer.files.strict_json import strict_json
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View, write_views
from vpltune.tuner.doctor.jax_platform import require_jax_platform
from vpltune.tuner.evaluation.comparison_image import comparison_image
from vpltune.tuner.evaluation.error_breakdown import error_breakdown
from vpltune.tuner.evaluation.evaluate import Evaluation, evaluate
from vpltune.tuner.evaluation.evidence import doubts, undetermined
from vpltune.tuner.evaluation.guard import Verdict, verdict
from vpltune.tuner.evaluation.prepare_scene import (
    PreparedScene,
    Progress,
    SceneOptions,
    Stopwatch,
    prepare_scene,
)
from vpltune.tuner.evaluation.validation import candidates, validation_metrics
from vpltune.tuner.evaluation.view_images import write_view_images
from vpltune.tuner.fitting.fit_density import FEW_VPLS, table_rotations
from vpltune.tuner.fitting.fit_own_loss import Loss, loss_name
from vpltune.tuner.fitting.fit_placement import Trace
from vpltune.tuner.fitting.fit_status import Descent, FitStatus, Outcome
from vpltune.tuner.fitting.search_space import SearchSpace
from vpltune.tuner.frame_time.fit_budget import FRONT_FILES, BudgetOptions, Front
from vpltune.tuner.frame_time.frame_budget import LEAST_COUNT
from vpltune.tuner.frame_time.least_frame import require_possible_budget
from vpltune.tuner.reference.content_key import scene_digest
from vpltune.tuner.scene_fit.fit_result import FitResult
from vpltune.tuner.scene_fit.fit_search import Search, search
from vpltune.tuner.scene_fit.prior_in_fit import auto_candidate, fit_start, prior_metrics
from vpltune.tuner.surrogate.captured_view import CapturedView, capture_views

VALIDATION_ROTATIONS = 4
"""Rotations of the point table in each validation view, with few VPLs. A choice: the error of one rotation is
mostly chance."""


@dataclass(frozen=True, eq=False)
class FitOptions(SceneOptions):
    """What to fit, and in which views."""

    start: TunedConfig = field(default_factory=TunedConfig)
    """Where the fit begins, and the values of everything that is not fitted."""
    budget: BudgetOptions | None = None
    """Picks VPL count and quality settings that meet a frame time (`tuner.frame_time.fit_budget`)."""
    motion: bool = False
    """Accepts only a result that flickers no more than the start when lights move."""
    traced: Trace | None = None
    """Called with parameters that the search tried and their cost, for someone who watches."""
    loss: Loss | None = None
    """Fits k, α and κ to a function of one's own (`tuner.fitting.fit_own_loss`); excludes `budget`."""
    command: str | None = None
    """The command line, for the provenance in metrics.json; None if the fit was called from Python."""


def fit_scene(
    source: Path | Scene, output: Path | None, options: FitOptions, progress: Progress
) -> FitResult:
    """Fit a scene; write tuned.json, views.json, metrics.json, images.npz and comparison.png to `output`.

    A front of `options.budget` is written with them. No file is written before the fit and its measurement
    are done, and all change together. References are kept in the user's cache as soon as they are rendered,
    so an interrupted run does not render them again.

    Args:
        source: a scene file, or a scene in memory.
        output: the folder to write to, created if it does not exist; None writes nothing.
        options: what to fit, and in which views.
        progress: called with the name of a stage and the share of it that is done, in [0, 1].

    Raises:
        InputError: the scene, its sidecar, the output folder or the loss cannot be used, no frame meets the
            budget, or options exclude each other.
        MachineError: there is no OpenGL 4.5, or the GPU ran out of memory.
    """
    watch = Stopwatch()
    _require_compatible(options, output)
    if output is not None:
        require_writable(output)
    require_jax_platform()
    prepared = prepare_scene(
        source,
        options,
        options.start,
        watch,
        progress,
        validated=True,
        look_first=partial(_require_budget, options),
    )
    fitted = [view for view in prepared.views if view.view.split == "fitted"]
    drawn = [view.drawn_with.parameters for view in fitted if view.drawn_with is not None]
    start = replace(options.start, parameters=fit_start(options.start, drawn), auto=None)
    if any(view.lit for view in fitted):
        found = _judged(prepared, start, options, watch, progress)
    else:
        found = _unlit(start)
    with watch.stage("evaluate"):
        evaluation = _evaluated(prepared, found, options, progress)
    breakdown = {}
    if options.split_error:
        with watch.stage("split error"):
            breakdown["error_breakdown"] = error_breakdown(
                prepared, evaluation, lambda share: progress("split error", share)
            )
    config = _config(prepared, found, options)
    views = (*(view.view for view in prepared.views), *(view for view, _ in prepared.validation))
    notes = (*prepared.notes, *evaluation.notes(), *found.notes)
    descent = found.descent
    document = {
        "scene": str(source) if isinstance(source, Path) else source.name,
        "parameters": config.parameters.as_dict(),
        "visibility": config.visibility,
        "quality": config.quality.as_dict(),
        "views": None if output is None else str(output / "views.json"),
        "metrics": evaluation.summary(),
        "seconds": watch.report(),
        "status": found.status,
        "sentence": found.sentence,
        "loss": {
            "function": None if options.loss is None else loss_name(options.loss),
            "start": descent.start_loss,
            "end": descent.loss,
            "steps": len(descent.losses) - 1,
            "curve": descent.losses.tolist(),
        },
        "uncertainty": {name: asdict(interval) for name, interval in found.known.items()},
        **({} if found.verdict is None else {"validation": found.verdict.document()}),
        **breakdown,
        "ceiling_parameters": evaluation.ceiling_parameters.as_dict(),
        "per_view": evaluation.per_view(),
        "notes": list(notes),
        **found.document,
        "provenance": {
            **config.provenance,
            "python": platform.python_version(),
            "platform": platform.platform(),
            "opengl": prepared.runtime.opengl_renderer,
            "command": options.command,
        },
    }
    result = FitResult(
        config=config,
        status=found.status,
        descent=descent,
        evaluation=evaluation,
        notes=notes,
        document=document,
        fitted=found.fitted,
        start=start.parameters,
        views=views,
        comparison=comparison_image(prepared.runtime, evaluation.most_and_least_gained()),
    )
    if output is not None:
        _write(result, output, found.front)
    return result


def _write(result: FitResult, output: Path, front: Front | None) -> None:
    with written_together(output, FRONT_FILES) as folder:
        if front is not None:
            front.write(folder)
        write_views(folder / "views.json", result.document["scene"], result.views)
        write_png(folder / "comparison.png", result.comparison)
        write_view_images(folder / "images.npz", result.evaluation.views)
        write_config(folder / "tuned.json", result.config)
        write_text_whole(folder / "metrics.json", strict_json(result.document) + "\n")
    if front is not None:
        front.forget()


def _require_compatible(options: FitOptions, output: Path | None) -> None:
    budget = options.budget
    if budget is not None and options.loss is not None:
        raise InputError("loss: cannot be fitted to a frame-time budget; leave out budget")
    if budget is not None and budget.pareto and output is None:
        raise InputError("output: must be a folder for the files of a Pareto front, got None")


def _require_budget(options: FitOptions, runtime: Runtime, views: tuple[View, ...]) -> None:
    budget = options.budget
    if budget is None or budget.milliseconds is None:
        return
    timed = replace(views[0], size=budget.frame_size or views[0].size)
    require_possible_budget(runtime, timed, options.start, budget.milliseconds, LEAST_COUNT)


@dataclass(frozen=True, eq=False)
class _Found:
    """How a fit ended."""

    status: Outcome
    sentence: str
    config: TunedConfig
    """The tuned config, or the start if it was kept, without provenance."""
    start: TunedConfig
    """The start with the VPL count and quality of `config`, so that both cost the same."""
    descent: Descent
    fitted: ArtistParameters
    """What the search found, whether or not it was accepted."""
    known: dict[str, Any] = field(default_factory=dict)
    """`tuner.fitting.uncertainty.Interval` by parameter."""
    verdict: Verdict | None = None
    captured: tuple[CapturedView, ...] = ()
    """The lit fitted views, captured with the placement that the search found."""
    notes: tuple[str, ...] = ()
    document: dict[str, Any] = field(default_factory=dict)
    """Further keys of metrics.json."""
    front: Front | None = None
    """The Pareto front, if one was asked for."""


def _unlit(start: TunedConfig) -> _Found:
    point = SearchSpace().point(start.parameters)
    descent = Descent(point, float("nan"), float("nan"), np.array([np.nan]), FitStatus.NOTHING_LIT)
    return _Found("unlit", descent.status.value, start, start, descent, start.parameters)


def _judged(
    prepared: PreparedScene,
    start: TunedConfig,
    options: FitOptions,
    watch: Stopwatch,
    progress: Progress,
) -> _Found:
    """Search on the fitted views, then choose between the candidates on the validation views."""
    with watch.stage("fit"):
        found = search(
            prepared,
            start,
            budget=options.budget,
            loss=options.loss,
            seed=options.seed,
            progress=lambda share: progress("fit", share),
            traced=options.traced,
        )
    baseline = replace(
        start,
        parameters=replace(start.parameters, vpl_count=found.tuned.vpl_count),
        quality=found.quality,
    )
    with watch.stage("validate"):
        chosen, doubt = _validated(prepared, baseline, found, options, progress)
    if found.descent.status is FitStatus.NOT_FINITE:
        doubt = (*doubt, "the loss at the start is not a finite number")
    status: Outcome
    if doubt:
        status, sentence, parameters = (
            "doubtful",
            f"{'; '.join(doubt)}; the start is kept",
            baseline.parameters,
        )
    elif chosen is not None and chosen.chosen is not None:
        status, sentence, parameters = "improved", chosen.sentence, chosen.chosen.parameters
    else:
        assert chosen is not None, "nothing is in doubt, so the candidates were judged"
        status, sentence, parameters = "kept", chosen.sentence, baseline.parameters
    # An interval is around the optimum on the fitted views; validation may choose a value outside it.
    known = {
        name: replace(interval, value=float(getattr(parameters, name)))
        for name, interval in found.known.items()
    }
    notes = undetermined(found.known, parameters)
    if found.document.keys() & {"budget", "pareto"} and parameters != found.tuned:
        notes = (*notes, "the budget figures are those of the fitted parameters, which were not chosen")
    return _Found(
        status,
        sentence,
        baseline.with_parameters(parameters),
        baseline,
        found.descent,
        found.tuned,
        known,
        chosen,
        found.views,
        notes,
        found.document,
        found.front,
    )


def _validated(
    prepared: PreparedScene,
    start: TunedConfig,
    found: Search,
    options: FitOptions,
    progress: Progress,
) -> tuple[Verdict | None, tuple[str, ...]]:
    """The choice on the validation views, None with fewer than two lit ones, and the reasons not to judge by
    them."""
    # With a loss of one's own, only what minimises it may take the start's place.
    auto = None if options.loss is not None else auto_candidate(prepared, start, options.start)
    tried = candidates(start.parameters, found.base, found.tuned, auto)
    # The identity, which the runtime draws with, and rotations that the density was not fitted to.
    rotations = table_rotations(VALIDATION_ROTATIONS - 1, options.seed, held_out=True)
    few = start.parameters.vpl_count <= FEW_VPLS or options.budget is not None
    metrics, captured = validation_metrics(
        prepared.runtime,
        prepared.validation,
        {"start": start, **{name: start.with_parameters(each) for name, each in tried.items()}},
        ((0.0, 0.0), *rotations) if few else ((0.0, 0.0),),
        motion=options.motion,
        progress=lambda share: progress("validate", share),
    )
    if options.start.auto is not None and options.budget is None:
        metrics["start"] = prior_metrics(prepared, options.start)
    fitted = [view for view in prepared.views if view.view.split == "fitted"]
    doubt = doubts(fitted, captured)
    if len(metrics["start"]) < 2:
        return None, doubt
    judged = {name: (parameters, metrics[name]) for name, parameters in tried.items()}
    return verdict(metrics["start"], judged), doubt


def _evaluated(prepared: PreparedScene, found: _Found, options: FitOptions, progress: Progress) -> Evaluation:
    """Measure default, tuned and ceiling in the fitted and held-out views."""
    tuned = found.config
    known = (*prepared.views, *found.captured)
    views = []
    for view in prepared.views:
        same = [
            each
            for each in known
            if each.view is view.view and each.drawn_with is not None and _same_vpls(each.drawn_with, tuned)
        ]
        if not same:
            same = list(capture_views(prepared.runtime, tuned, (view.view,), (view.reference,)))
        views.append(same[0])
    kept_prior = _keeps_prior(found, options)
    default = default_like(options.start.parameters)
    return evaluate(
        prepared.scene,
        prepared.runtime,
        prepared.views if kept_prior else tuple(views),
        tuned.with_parameters(replace(default, vpl_count=tuned.parameters.vpl_count)),
        None if kept_prior else tuned,
        seed=options.seed,
        known=known,
        progress=lambda share: progress("evaluate", share),
    )


def _same_vpls(first: TunedConfig, second: TunedConfig) -> bool:
    """Whether both configs draw the same VPLs and visibility maps."""
    return (
        placement(first.parameters) == placement(second.parameters)
        and first.visibility == second.visibility
        and replace(first.quality, interleave=1) == replace(second.quality, interleave=1)
    )


def default_like(start: ArtistParameters) -> ArtistParameters:
    """The default parameters, with the start's VPL count and screen-space near field."""
    kept = ("vpl_count", "screen_space_radius", "screen_space_strength")
    return replace(ArtistParameters(), **{name: getattr(start, name) for name in kept})


def _keeps_prior(found: _Found, options: FitOptions) -> bool:
    """Whether the config keeps the start's prior: the start was kept, and no budget changed it."""
    kept = found.config.draws_as(found.start)
    return kept and options.start.auto is not None and options.budget is None


def _config(prepared: PreparedScene, found: _Found, options: FitOptions) -> TunedConfig:
    file = {} if prepared.file_sha256 is None else {"scene_file_sha256": prepared.file_sha256}
    provenance: dict[str, str | int | float] = {
        "scene": prepared.scene.name,
        **file,
        "scene_content_sha256": scene_digest(prepared.scene),
        "vpltune": importlib.metadata.version("vpltune"),
        "mitsuba": importlib.metadata.version("mitsuba"),
        "jax": importlib.metadata.version("jax"),
        "views": options.views,
        "seed": options.seed,
        "bounces": options.start.light.bounces,
    }
    chosen = options.start if _keeps_prior(found, options) else found.config
    return replace(chosen, provenance=provenance, fit=FitNote(found.status, found.sentence))
