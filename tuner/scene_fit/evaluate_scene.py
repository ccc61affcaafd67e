"""`vpltune evaluate`: measures a config on a scene, as default, tuned and ceiling against the reference."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.files.cache_folder import cache_folder
from vpltune.renderer.scene.views import write_views
from vpltune.tuner.evaluation.error_breakdown import error_breakdown
from vpltune.tuner.evaluation.evaluate import Evaluation, evaluate
from vpltune.tuner.evaluation.prepare_scene import Progress, SceneOptions, Stopwatch, prepare_scene
from vpltune.tuner.reference.content_key import scene_digest
from vpltune.tuner.scene_fit.fit_scene import default_like


@dataclass(frozen=True, eq=False)
class EvaluateOptions(SceneOptions):
    """What to measure, and in which views."""

    tuned: TunedConfig = field(default_factory=TunedConfig)
    """The config to measure."""
    views_path: Path | None = None
    """The file that `fixed_views` were read from; None writes the views to the user's cache, if it can be
    written to."""


@dataclass(frozen=True, eq=False)
class SceneEvaluation:
    """The result of `evaluate_scene`."""

    evaluation: Evaluation
    document: dict[str, Any]
    """What `vpltune evaluate --json` prints."""


def evaluate_scene(scene_path: Path, options: EvaluateOptions, progress: Progress) -> SceneEvaluation:
    """Measure a config on a scene's fitted and held-out views.

    Args:
        scene_path: a scene file.
        options: the config and the views.
        progress: called with the name of a stage and the share of it that is done, in [0, 1].

    Raises:
        InputError: the scene or its sidecar cannot be used.
        MachineError: there is no OpenGL 4.5, or the GPU ran out of memory.
    """
    watch = Stopwatch()
    prepared = prepare_scene(scene_path, options, options.tuned, watch, progress)
    with watch.stage("evaluate"):
        evaluation = evaluate(
            prepared.scene,
            prepared.runtime,
            prepared.views,
            options.tuned.with_parameters(default_like(options.tuned.parameters)),
            None if options.tuned.auto is not None else options.tuned,
            seed=options.seed,
            progress=lambda share: progress("evaluate", share),
        )
    breakdown = {}
    if options.split_error:
        with watch.stage("split error"):
            breakdown["error_breakdown"] = error_breakdown(
                prepared,
                evaluation,
                lambda share: progress("split error", share),
            )
    notes = (*prepared.notes, *evaluation.notes())
    views_path = options.views_path
    if views_path is None:
        views_path = cache_folder() / "views" / f"{scene_digest(prepared.scene)[:16]}-{options.seed}.json"
        try:
            write_views(views_path, str(scene_path), tuple(view.view for view in prepared.views))
        except (InputError, MachineError) as error:
            views_path, notes = None, (*notes, f"the views are not kept: {error}")
    document = {
        "scene": str(scene_path),
        "parameters": options.tuned.parameters.as_dict(),
        "visibility": options.tuned.visibility,
        "quality": options.tuned.quality.as_dict(),
        "views": None if views_path is None else str(views_path),
        "metrics": evaluation.summary(),
        "seconds": {**watch.report(), "fit": 0.0},
        "status": "ok",
        **breakdown,
        "ceiling_parameters": evaluation.ceiling_parameters.as_dict(),
        "per_view": evaluation.per_view(),
        "notes": list(notes),
    }
    return SceneEvaluation(evaluation, document)
