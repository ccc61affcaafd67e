"""`vpltune fit`: fits a config to a scene."""

import shlex
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from vpltune.cli.command_line import command_line
from vpltune.cli.options import (
    VIEW_COUNT,
    BouncesOption,
    JsonOption,
    SceneArgument,
    SeedOption,
    SplitErrorOption,
    StartOption,
    ViewSizeOption,
    ViewsOrFileOption,
    VisibilityOption,
    parse_size,
)
from vpltune.cli.report import Report, warn
from vpltune.cli.view_options import ViewFlags, takes_view_flags


@takes_view_flags
def fit(
    scene: SceneArgument,
    output: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="DIR", help="Folder for tuned.json, images and metrics."),
    ],
    config: StartOption = "default",
    views: ViewsOrFileOption = str(VIEW_COUNT),
    size: ViewSizeOption = None,
    seed: SeedOption = 0,
    visibility: VisibilityOption = None,
    vpl_count: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=65536,
            help="VPL count to fit for.",
            show_default=False,
        ),
    ] = None,
    budget_ms: Annotated[
        float | None,
        typer.Option(
            metavar="MS",
            help="Pick the VPL count and quality settings that meet this frame time on this machine.",
            show_default=False,
        ),
    ] = None,
    pareto: Annotated[
        bool, typer.Option("--pareto", help="Write the Pareto front of error against frame time.")
    ] = False,
    frame_size: Annotated[
        str | None,
        typer.Option(metavar="WxH", help="Size of the timed frames, in pixels. [--size]", show_default=False),
    ] = None,
    motion: Annotated[
        bool,
        typer.Option("--motion", help="Accept a fit only if it flickers no more than the start."),
    ] = False,
    bounces: BouncesOption = None,
    split_error: SplitErrorOption = False,
    *,
    flags: ViewFlags,
    json: JsonOption = False,
) -> Report:
    """Fit a scene; write DIR/tuned.json, views.json, metrics.json, and images before and after."""
    from vpltune.cli.budget_flags import budget_from_flags, with_vpl_count
    from vpltune.cli.progress_display import shown_progress
    from vpltune.cli.quality_flags import with_flags
    from vpltune.cli.view_flags import camera_from_flags, light_from_flags, sky_from_flags
    from vpltune.cli.views_or_file import views_or_file
    from vpltune.renderer.config.tuned_config import read_config
    from vpltune.tuner.scene_fit.fit_scene import FitOptions, fit_scene

    given = views_or_file(views, flags.place_a_view)
    start, overridden = with_flags(read_config(config), visibility=visibility, bounces=bounces)
    warn(overridden)
    options = FitOptions(
        start=with_vpl_count(start, vpl_count),
        budget=budget_from_flags(vpl_count, budget_ms, pareto, frame_size),
        motion=motion,
        views=given if isinstance(given, int) else len(given[1]),
        fixed_views=None if isinstance(given, int) else given[1],
        seed=seed,
        split_error=split_error,
        camera=camera_from_flags(flags),
        camera_name=flags.camera,
        light=light_from_flags(flags),
        sky=sky_from_flags(flags.sky, flags.environment),
        command=command_line(),
    )
    if size is not None:
        options = replace(options, size=parse_size(size))
    with shown_progress() as progress:
        result = fit_scene(scene, output, options, progress)
    warn(result.notes)
    return _report(result.document, output)


def _report(document: dict, output: Path) -> Report:
    from rich.markup import escape

    from vpltune.cli.budget_flags import budget_lines
    from vpltune.cli.metrics_table import error_breakdown_table, metrics_table, parameters_table

    config, image = output / "tuned.json", output / "tuned.png"
    command = ["vpltune", "render", document["scene"], "--config", str(config), "-o", str(image)]
    budget = document["quality"].get("budget")
    if budget is not None:
        command += ["--size", "{}x{}".format(*budget["frame_size"])]
    shown = (
        parameters_table(document["parameters"], document["uncertainty"]),
        metrics_table(document["metrics"]),
        *error_breakdown_table(document),
        escape(f"{document['status']}: {document['sentence']} ({document['seconds']['total']:.1f} s)"),
        *budget_lines(document),
        f"image: {escape(str(output / 'comparison.png'))}",
        f"next:    {escape(shlex.join(command))}",
        f"report:  {escape(shlex.join(('vpltune', 'report', str(output))))}",
    )
    return Report(document, shown)
