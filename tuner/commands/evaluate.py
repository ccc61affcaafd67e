"""`vpltune evaluate`: how close a config comes to the path tracer."""

from typing import Annotated

import typer

from tuner.commands.options import (
    Bounces,
    EyeOption,
    JsonOption,
    LightConeOption,
    LightDirectionOption,
    LightIntensityOption,
    LightLookAtOption,
    LightPositionOption,
    LightTypeOption,
    LookAtOption,
    SceneArgument,
    SeedOption,
    YfovOption,
)
from tuner.commands.report import OK, PARTLY_DONE, Report


def evaluate(
    scene: SceneArgument,
    config: Annotated[str, typer.Option(metavar="FILE", help="The tuned config: a file, or `default`.")],
    views: Annotated[int, typer.Option(min=1, max=64, help="How many views, of those that were fitted.")] = 2,
    seed: SeedOption = 0,
    bounces: Annotated[
        Bounces, typer.Option(help="What to compare with: one bounce, or full global illumination.")
    ] = "1",
    eye: EyeOption = None,
    look_at: LookAtOption = None,
    yfov: YfovOption = None,
    light_type: LightTypeOption = None,
    light_position: LightPositionOption = None,
    light_look_at: LightLookAtOption = None,
    light_direction: LightDirectionOption = None,
    light_intensity: LightIntensityOption = None,
    light_cone: LightConeOption = None,
    json: JsonOption = False,
) -> Report:
    """Compare default, tuned and ceiling with the reference, on fitted and on held-out views and lights."""
    from renderer.tuned_config import read_config
    from tuner.commands.metrics_table import metrics_table
    from tuner.commands.progress_display import shown_progress
    from tuner.commands.view_flags import ViewFlags, camera_from_flags, light_from_flags
    from tuner.evaluate_scene import EvaluateOptions, evaluate_scene

    flags = ViewFlags(
        eye,
        look_at,
        yfov,
        light_type,
        light_position,
        light_look_at,
        light_direction,
        light_intensity,
        light_cone,
    )
    options = EvaluateOptions(
        tuned=read_config(config),
        views=views,
        seed=seed,
        bounces=bounces,
        camera=camera_from_flags(flags),
        light=light_from_flags(flags),
    )
    with shown_progress() as progress:
        document = evaluate_scene(scene, options, progress).document
    shown = (metrics_table(document["metrics"]), document["status"])
    return Report(document, shown, OK if document["status"] == "ok" else PARTLY_DONE)
