"""Job one: a scene in, a tuned config and the proof of it out."""

import importlib.metadata
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from statistics import fmean
from typing import Any

from renderer.artist_parameters import ARTIST_PARAMETERS, ArtistParameters, parameter_spec
from renderer.atomic_file import write_text_whole
from renderer.auto_prior import AUTO_PARAMETERS, place_of, value_at
from renderer.errors import InputError
from renderer.strict_json import strict_json
from renderer.tuned_config import TunedConfig, read_config, write_config
from renderer.views import write_views
from tuner.captured_view import CapturedView, capture_views
from tuner.comparison_picture import write_comparison
from tuner.error_budget import error_budget
from tuner.evaluate import SPLITS, EvaluatedView, Evaluation, evaluate
from tuner.fit_budget import BudgetOptions, fit_to_budget
from tuner.fit_density import density_document, fit_density
from tuner.fit_falloff import fit_views
from tuner.fit_status import Descent
from tuner.fit_visibility import fit_visibility
from tuner.prepare_scene import PreparedScene, Progress, SceneOptions, Stopwatch, prepare_scene
from tuner.reference.content_key import scene_digest
from tuner.search_space import SearchSpace, held_for
from tuner.uncertainty import Interval, fit_with_intervals, intervals
from tuner.view_pictures import write_view_pictures

PANEL_HEIGHT = 240
"""Pixels; the panels of comparison.png are at least this high."""


@dataclass(frozen=True, eq=False)
class FitOptions(SceneOptions):
    """`start`: where the fit begins, and what the parameters that are not fitted stay at.

    density: fit to several rotations of the point table, and where the VPLs stand with it.
    budget: fit to a frame's time, the count and how the frame is drawn with it; see `tuner.fit_budget`.
    command: what was typed, for the record; None where the fit was asked for from Python.
    """

    start: TunedConfig = field(default_factory=TunedConfig)
    density: bool = False
    budget: BudgetOptions | None = None
    command: str | None = None


@dataclass(frozen=True, eq=False)
class FitResult:
    """What `fit_scene` made."""

    config: TunedConfig
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
        output: the folder for tuned.json, views.json, metrics.json, pictures.npz and comparison.png.
        config: where the fit starts: a config file, or "default".
        progress: called with a stage's name and the share of it that is done, in [0, 1].
        options: fields of `tuner.prepare_scene.SceneOptions`: views, seed, bounces, camera, light, size …

    Example:
        >>> result = tuner.fit("configs/scenes/cornell-box.glb", "out/cornell", views=4)
        >>> renderer.Runtime(renderer.read_scene(path), result.config).render(view)
    """
    chosen = FitOptions(start=read_config(config), **options)
    return fit_scene(Path(scene), Path(output), chosen, progress or (lambda stage, share: None))


def fit_scene(scene_path: Path, output: Path, options: FitOptions, progress: Progress) -> FitResult:
    """Fit a scene; write tuned.json, views.json, metrics.json, pictures.npz and comparison.png to `output`.

    Every file is written whole, and only once the fit and its measurement are done. References are kept
    in the user's cache as they are made, so a run that was stopped goes on where it was.

    Raises:
        InputError: the scene, its sidecar or the output folder cannot be used.
        MachineError: no OpenGL.
    """
    watch = Stopwatch()
    if output.exists() and not output.is_dir():
        raise InputError(f"{output}: the output must be a folder, and is a file")
    prepared = prepare_scene(scene_path, options, options.start, watch, progress)
    default = default_like(options.start.parameters)
    with watch.stage("fit"):
        tuned, descent, known, views, found = _fitted(prepared, options, output, progress)
    with watch.stage("evaluate"):
        evaluation = evaluate(
            prepared.scene,
            prepared.runtime,
            views,
            replace(default, vpl_count=tuned.vpl_count),
            tuned,
            seed=options.seed,
            progress=lambda share: progress("evaluate", share),
        )
    budget = {}
    if options.split_error:
        with watch.stage("split error"):
            budget["error_budget"] = error_budget(
                prepared, evaluation, options, lambda share: progress("split error", share)
            )
    config = TunedConfig(tuned, _provenance(prepared, options, descent), options.start.visibility)
    write_views(output / "views.json", str(scene_path), tuple(view.view for view in prepared.views))
    write_comparison(
        output / "comparison.png", prepared.runtime, _first_of_each_split(evaluation), PANEL_HEIGHT
    )
    write_view_pictures(output / "pictures.npz", evaluation.views)
    write_config(output / "tuned.json", config)
    notes = (*prepared.notes, *evaluation.notes())
    document = {
        "scene": str(scene_path),
        "parameters": tuned.as_dict(),
        "visibility": config.visibility,
        "views": str(output / "views.json"),
        "metrics": evaluation.summary(),
        "seconds": watch.report(),
        "status": descent.status.outcome,
        "sentence": descent.status.value,
        "loss": {
            "start": descent.start_loss,
            "end": descent.loss,
            "steps": len(descent.losses) - 1,
            "curve": descent.losses.tolist(),
        },
        "uncertainty": {name: asdict(interval) for name, interval in known.items()},
        **budget,
        "ceiling_parameters": evaluation.ceiling_parameters.as_dict(),
        "per_view": evaluation.per_view(),
        "notes": list(notes),
        **found,
        "provenance": {
            **config.provenance,
            "python": platform.python_version(),
            "platform": platform.platform(),
            "opengl": prepared.runtime.opengl_renderer,
            "command": options.command,
        },
    }
    write_text_whole(output / "metrics.json", strict_json(document) + "\n")
    return FitResult(config, descent, evaluation, notes, document)


def _fitted(
    prepared: PreparedScene, options: FitOptions, output: Path, progress: Progress
) -> tuple[ArtistParameters, Descent, dict[str, Interval], tuple[CapturedView, ...], dict[str, Any]]:
    """Parameters, how the fit ended, their intervals, views captured for them, what metrics.json gains."""
    views, seed = _of_fitted(prepared.views), options.seed
    start = fit_start(options.start, [view.drawn_with for view in views if view.drawn_with is not None])

    def report(share: float) -> None:
        progress("fit", share)

    lit = any(view.lit for view in views)
    if options.budget is not None and lit:
        tuned, descent, found = fit_to_budget(
            prepared,
            replace(options.start, parameters=start, auto=None),
            options.budget,
            output,
            seed=seed,
            progress=report,
        )
    elif options.density and lit:
        density = fit_density(prepared.runtime, views, start, seed=seed, progress=report)
        tuned, descent = density.parameters, density.descent
        default = default_like(options.start.parameters)
        measured = tuple(view for view in views if view.lit)
        document = density_document(prepared.runtime, measured, default, density, seed)
        found = {"density": document}
    else:
        if options.start.visibility == "maps":
            start, _ = fit_visibility(views, start, seed=seed)
        ready = fit_views(views, start, seed=seed)
        tuned, descent, known = fit_with_intervals(
            ready, start, held=held_for(options.start.visibility), progress=report
        )
        return tuned, descent, known, prepared.views, {}
    # The VPLs are others now, in number and in place.
    prepared.runtime.parameters = tuned
    references = tuple(view.reference for view in prepared.views)
    captured = capture_views(prepared.runtime, tuple(view.view for view in prepared.views), references)
    if descent.status.nothing_fitted:
        return tuned, descent, {}, captured, found
    # Of one rotation: several of one view err together, and would pass for so many witnesses.
    ready = fit_views(_of_fitted(captured), tuned, seed=seed)
    names = frozenset(SearchSpace().names) - held_for(options.start.visibility)
    return tuned, descent, intervals(ready, tuned, names), captured, found


def _of_fitted(views: tuple[CapturedView, ...]) -> tuple[CapturedView, ...]:
    return tuple(view for view in views if view.view.split == "fitted")


def fit_start(config: TunedConfig, drawn: Sequence[ArtistParameters]) -> ArtistParameters:
    """The config's parameters; of a prior, the mean in the unit cube of what views were drawn with."""
    if config.visibility == "none":
        # What the runtime does not look at shall not look as if it did.
        return replace(config.parameters, falloff_transmittance=0.0)
    if config.auto is None:
        return config.parameters
    values = {}
    for name in AUTO_PARAMETERS:
        spec = parameter_spec(name)
        values[name] = value_at(spec, fmean(place_of(spec, getattr(each, name)) for each in drawn))
    return replace(config.parameters, **values)


def default_like(start: ArtistParameters) -> ArtistParameters:
    """The defaults at the start's own cost: what is not fitted is the same in all that is compared."""
    kept = {spec.name: getattr(start, spec.name) for spec in ARTIST_PARAMETERS if not spec.fitted}
    return ArtistParameters(**{**ArtistParameters().as_dict(), **kept})


def _provenance(
    prepared: PreparedScene, options: FitOptions, descent: Descent
) -> dict[str, str | int | float]:
    return {
        "scene": prepared.scene.name,
        "scene_sha256": scene_digest(prepared.scene),
        "vpltune": importlib.metadata.version("vpltune"),
        "mitsuba": importlib.metadata.version("mitsuba"),
        "jax": importlib.metadata.version("jax"),
        "views": options.views,
        "seed": options.seed,
        "bounces": options.bounces,
        "fit": descent.status.value,
    }


def _first_of_each_split(evaluation: Evaluation) -> tuple[EvaluatedView, ...]:
    firsts = {view.view.view.split: view for view in reversed(evaluation.views)}
    return tuple(firsts[split] for split in SPLITS if split in firsts)
