"""Job one: a scene in, a tuned config and the proof of it out."""

import importlib.metadata
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec, placement
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS, place_of, value_at
from vpltune.renderer.config.tuned_config import FitNote, TunedConfig, read_config, write_config
from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.strict_json import strict_json
from vpltune.renderer.scene.views import write_views
from vpltune.tuner.evaluation.comparison_image import write_comparison
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
from vpltune.tuner.fitting.fit_density import table_rotations
from vpltune.tuner.fitting.fit_status import Descent, FitStatus, Outcome
from vpltune.tuner.fitting.search_space import SearchSpace
from vpltune.tuner.frame_time.fit_budget import BudgetOptions
from vpltune.tuner.metrics.view_metrics import ViewMetrics
from vpltune.tuner.reference.content_key import scene_digest
from vpltune.tuner.scene_fit.fit_search import Search, search
from vpltune.tuner.surrogate.captured_view import CapturedView, capture_views

VALIDATION_ROTATIONS = 4
"""Rotations of the point table in each validation view with few VPLs: a single placement is mostly luck."""


@dataclass(frozen=True, eq=False)
class FitOptions(SceneOptions):
    """`start`: where the fit begins, and what the parameters that are not fitted stay at.

    density: fit to several rotations of the point table, and where the VPLs stand with it.
    budget: fit to a frame's time, the count and how the frame is drawn with it; see `tuner.frame_time.fit_budget`.
    motion: whether the result must also be as steady as the start while lights move.
    command: what was typed, for the record; None where the fit was asked for from Python.
    """

    start: TunedConfig = field(default_factory=TunedConfig)
    density: bool = False
    budget: BudgetOptions | None = None
    motion: bool = False
    command: str | None = None


@dataclass(frozen=True, eq=False)
class FitResult:
    """What `fit_scene` made."""

    config: TunedConfig
    status: Outcome
    descent: Descent
    evaluation: Evaluation
    notes: tuple[str, ...]
    document: dict[str, Any]
    """What metrics.json holds, and `vpltune fit --json` prints."""


def fit(
    scene: str | Path,
    output: str | Path,
    *,
    config: str | Path = "default",
    progress: Progress | None = None,
    **options: Any,
) -> FitResult:
    """Fit a scene from Python as `vpltune fit` does; see `fit_scene` for what is written and raised.

    Args:
        scene: a glTF, OBJ or PLY file.
        output: the folder for tuned.json, views.json, metrics.json, images.npz and comparison.png.
        config: where the fit starts: a config file, or "default".
        progress: called with a stage's name and the share of it that is done, in [0, 1].
        options: fields of `tuner.evaluation.prepare_scene.SceneOptions`: views, seed, bounces, camera, light, size …

    Example:
        >>> result = vpltune.fit("configs/scenes/cornell-box.glb", "out/cornell", views=4)
        >>> vpltune.Runtime(vpltune.read_scene(path)).render(view, result.config)
    """
    chosen = FitOptions(start=read_config(config), **options)
    return fit_scene(Path(scene), Path(output), chosen, progress or (lambda stage, share: None))


def fit_scene(scene_path: Path, output: Path, options: FitOptions, progress: Progress) -> FitResult:
    """Fit a scene; write tuned.json, views.json, metrics.json, images.npz and comparison.png to `output`.

    Every file is written whole, and only once the fit and its measurement are done. References are kept
    in the user's cache as they are made, so a run that was stopped goes on where it was.

    Raises:
        InputError: the scene, its sidecar or the output folder cannot be used.
        MachineError: no OpenGL.
    """
    watch = Stopwatch()
    if output.exists() and not output.is_dir():
        raise InputError(f"{output}: the output must be a folder, and is a file")
    prepared = prepare_scene(scene_path, options, options.start, watch, progress, validated=True)
    fitted = [view for view in prepared.views if view.view.split == "fitted"]
    drawn = [view.drawn_with.parameters for view in fitted if view.drawn_with is not None]
    start = replace(options.start, parameters=fit_start(options.start, drawn), auto=None)
    if any(view.lit for view in fitted):
        found = _judged(prepared, start, options, output, watch, progress)
    else:
        found = _unlit(start)
    with watch.stage("evaluate"):
        evaluation = _evaluated(prepared, found, options, progress)
    breakdown = {}
    if options.split_error:
        with watch.stage("split error"):
            breakdown["error_breakdown"] = error_breakdown(
                prepared, evaluation, options, lambda share: progress("split error", share)
            )
    config = _config(prepared, found, options)
    views = (*(view.view for view in prepared.views), *(view for view, _ in prepared.validation))
    write_views(output / "views.json", str(scene_path), views)
    write_comparison(output / "comparison.png", prepared.runtime, evaluation.most_and_least_gained())
    write_view_images(output / "images.npz", evaluation.views)
    write_config(output / "tuned.json", config)
    notes = (*prepared.notes, *evaluation.notes(), *found.notes)
    descent = found.descent
    document = {
        "scene": str(scene_path),
        "parameters": config.parameters.as_dict(),
        "visibility": config.visibility,
        "quality": config.quality.as_dict(),
        "views": str(output / "views.json"),
        "metrics": evaluation.summary(),
        "seconds": watch.report(),
        "status": found.status,
        "sentence": found.sentence,
        "loss": {
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
    write_text_whole(output / "metrics.json", strict_json(document) + "\n")
    return FitResult(config, found.status, descent, evaluation, notes, document)


@dataclass(frozen=True, eq=False)
class _Found:
    """How a fit ended, and what it rests on."""

    status: Outcome
    sentence: str
    config: TunedConfig
    """What was found or kept, without provenance."""
    start: TunedConfig
    """The start at the cost of what was found: its VPL count and quality are those of `config`."""
    descent: Descent
    known: dict[str, Any] = field(default_factory=dict)
    verdict: Verdict | None = None
    captured: tuple[CapturedView, ...] = ()
    """Fitted views captured with the placement that the search ended at."""
    notes: tuple[str, ...] = ()
    document: dict[str, Any] = field(default_factory=dict)


def _unlit(start: TunedConfig) -> _Found:
    point = SearchSpace().point(start.parameters)
    descent = Descent(point, float("nan"), float("nan"), np.array([np.nan]), FitStatus.NOTHING_LIT)
    return _Found("unlit", descent.status.value, start, start, descent)


def _judged(
    prepared: PreparedScene,
    start: TunedConfig,
    options: FitOptions,
    output: Path,
    watch: Stopwatch,
    progress: Progress,
) -> _Found:
    """Search on the fitted views, and choose on the validation views."""
    with watch.stage("fit"):
        found = search(
            prepared,
            start,
            output,
            density=options.density,
            budget=options.budget,
            seed=options.seed,
            progress=lambda share: progress("fit", share),
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
    # An interval says where the fitted views have their optimum; validation may choose a value beside it.
    known = {
        name: replace(interval, value=float(getattr(parameters, name)))
        for name, interval in found.known.items()
    }
    notes = undetermined(found.known, parameters)
    if found.document.keys() & {"budget", "pareto"} and parameters != found.tuned:
        notes = (*notes, "the budget's figures are those of what was found; validation chose otherwise")
    return _Found(
        status,
        sentence,
        baseline.with_parameters(parameters),
        baseline,
        found.descent,
        known,
        chosen,
        found.views,
        notes,
        found.document,
    )


def _validated(
    prepared: PreparedScene,
    start: TunedConfig,
    found: Search,
    options: FitOptions,
    progress: Progress,
) -> tuple[Verdict | None, tuple[str, ...]]:
    """What the validation views choose, and what speaks against judging by them."""
    auto = _auto_candidate(prepared, start, options)
    tried = candidates(start.parameters, found.base, found.tuned, auto)
    # The first is what the runtime draws with; the others are not those that a density was fitted to.
    rotations = table_rotations(VALIDATION_ROTATIONS - 1, options.seed, held_out=True)
    few = options.density or options.budget is not None
    metrics, captured = validation_metrics(
        prepared.runtime,
        prepared.validation,
        {"start": start, **{name: start.with_parameters(each) for name, each in tried.items()}},
        ((0.0, 0.0), *rotations) if few else ((0.0, 0.0),),
        motion=options.motion,
        progress=lambda share: progress("validate", share),
    )
    if options.start.auto is not None and options.budget is None:
        metrics["start"] = _prior_metrics(prepared, options.start)
    fitted = [view for view in prepared.views if view.view.split == "fitted"]
    doubt = doubts(fitted, captured)
    if len(metrics["start"]) < 2:
        return None, doubt
    judged = {name: (parameters, metrics[name]) for name, parameters in tried.items()}
    return verdict(metrics["start"], judged), doubt


def _prior_metrics(prepared: PreparedScene, start: TunedConfig) -> list[ViewMetrics]:
    """The start's own, where a prior sets its parameters anew in each validation view."""
    runtime = prepared.runtime
    drawn = [
        CapturedView(view, reference, runtime.capture(view, start, maps=False))
        for view, reference in prepared.validation
    ]
    return [view.metrics(view.captured.indirect_irradiance) for view in drawn if view.lit]


def _auto_candidate(
    prepared: PreparedScene, start: TunedConfig, options: FitOptions
) -> ArtistParameters | None:
    """What the shipped prior sets at the start's placement, the mean over the fitted views in the unit cube.

    None where it was not trained for it: with clustered discs, or without maps.
    """
    parameters = start.parameters
    if (
        parameters.lloyd_iterations > 0
        or options.start.visibility != "maps"
        or options.start.auto is not None
    ):
        return None
    prior = read_config("auto").auto
    statistics = [
        view.statistics
        for view in prepared.views
        if view.view.split == "fitted"
        and view.statistics is not None
        and view.drawn_with is not None
        and view.drawn_with.parameters == parameters
    ]
    if prior is None or not statistics:
        return None
    set_by_view = [prior.parameters(each.astype(np.float64), parameters) for each in statistics]
    return _mean_parameters(parameters, set_by_view)


def _evaluated(prepared: PreparedScene, found: _Found, options: FitOptions, progress: Progress) -> Evaluation:
    """Default, tuned and ceiling in the fitted and the held-out views."""
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
    """Whether two configs draw the same VPLs and visibility maps."""
    return (
        placement(first.parameters) == placement(second.parameters)
        and first.visibility == second.visibility
        and replace(first.quality, interleave=1) == replace(second.quality, interleave=1)
    )


def fit_start(config: TunedConfig, drawn: Sequence[ArtistParameters]) -> ArtistParameters:
    """The config's parameters; with a prior, the mean in the unit cube of what views were drawn with."""
    return config.parameters if config.auto is None else _mean_parameters(config.parameters, drawn)


def _mean_parameters(rest: ArtistParameters, drawn: Sequence[ArtistParameters]) -> ArtistParameters:
    """The mean in the unit cube of what a prior sets; all else from `rest`."""
    values = {}
    for name in AUTO_PARAMETERS:
        spec = parameter_spec(name)
        values[name] = value_at(spec, fmean(place_of(spec, getattr(each, name)) for each in drawn))
    return replace(rest, **values)


def default_like(start: ArtistParameters) -> ArtistParameters:
    """The defaults with the start's VPL count and screen-space near field, which no fit changes."""
    kept = ("vpl_count", "screen_space_radius", "screen_space_strength")
    return replace(ArtistParameters(), **{name: getattr(start, name) for name in kept})


def _keeps_prior(found: _Found, options: FitOptions) -> bool:
    """Whether the start was kept, and has a prior; a budget's start is what the prior set on average."""
    kept = found.config.draws_as(found.start)
    return kept and options.start.auto is not None and options.budget is None


def _config(prepared: PreparedScene, found: _Found, options: FitOptions) -> TunedConfig:
    provenance: dict[str, str | int | float] = {
        "scene": prepared.scene.name,
        "scene_sha256": scene_digest(prepared.scene),
        "vpltune": importlib.metadata.version("vpltune"),
        "mitsuba": importlib.metadata.version("mitsuba"),
        "jax": importlib.metadata.version("jax"),
        "views": options.views,
        "seed": options.seed,
        "bounces": options.bounces,
    }
    chosen = options.start if _keeps_prior(found, options) else found.config
    return replace(chosen, provenance=provenance, fit=FitNote(found.status, found.sentence))
