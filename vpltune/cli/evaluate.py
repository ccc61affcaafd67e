"""`vpltune evaluate`: measures a config against the path tracer."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vpltune.cli.options import (
    VIEW_COUNT,
    BouncesOption,
    JsonOption,
    SceneArgument,
    SeedOption,
    SplitErrorOption,
    VisibilityOption,
)
from vpltune.cli.report import Report, warn
from vpltune.cli.view_options import ViewFlags, takes_view_flags

if TYPE_CHECKING:
    from vpltune.renderer.scene.views import View


@takes_view_flags
def evaluate(
    scene: SceneArgument,
    config: Annotated[
        str, typer.Option(metavar="FILE", help="Config to measure: a file, `default` or `auto`.")
    ],
    views: Annotated[
        str, typer.Option(metavar="N|FILE", help="Number of fitted views, or the views.json of a fit.")
    ] = str(VIEW_COUNT),
    seed: SeedOption = 0,
    visibility: VisibilityOption = None,
    bounces: BouncesOption = None,
    split_error: SplitErrorOption = False,
    *,
    flags: ViewFlags,
    json: JsonOption = False,
) -> Report:
    """Compare default, tuned and ceiling with the reference, on fitted and on held-out views and lights."""
    from rich.markup import escape

    from vpltune.cli.metrics_table import error_breakdown_table, metrics_table
    from vpltune.cli.progress_display import shown_progress
    from vpltune.cli.quality_flags import with_flags
    from vpltune.cli.view_flags import camera_from_flags, light_from_flags, sky_from_flags
    from vpltune.cli.views_or_file import views_or_file
    from vpltune.renderer.config.tuned_config import read_config
    from vpltune.tuner.scene_fit.evaluate_scene import EvaluateOptions, evaluate_scene

    tuned, overridden = with_flags(read_config(config), visibility=visibility, bounces=bounces)
    warn(overridden)
    options = EvaluateOptions(
        tuned=tuned,
        seed=seed,
        split_error=split_error,
        camera=camera_from_flags(flags),
        light=light_from_flags(flags),
        sky=sky_from_flags(flags.sky, flags.environment),
        camera_name=flags.camera,
        **_views_option(views_or_file(views, flags.place_a_view)),
    )
    with shown_progress() as progress:
        document = evaluate_scene(scene, options, progress).document
    warn(tuple(document["notes"]))
    shown = (
        metrics_table(document["metrics"]),
        *error_breakdown_table(document),
        *(() if document["views"] is None else (f"views: {escape(document['views'])}",)),
    )
    return Report(document, shown)


def _views_option(views: "int | tuple[Path, tuple[View, ...]]") -> dict[str, Any]:
    if isinstance(views, int):
        return {"views": views}
    path, fixed = views
    return {"views_path": path, "fixed_views": fixed}
