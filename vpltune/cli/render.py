"""`vpltune render`: draws an image, one of its layers, or a clip."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vpltune.cli.options import (
    BouncesOption,
    InterleaveOption,
    JsonOption,
    Layer,
    MapRefinementOption,
    MapSizeOption,
    Motion,
    RsmResolutionOption,
    SceneArgument,
    SkyLightsOption,
    VisibilityOption,
    checked_scale,
)
from vpltune.cli.report import Report, warn
from vpltune.cli.verbosity import detail
from vpltune.cli.view_options import (
    ImageSizeOption,
    ViewFlags,
    ViewNameOption,
    ViewsFileOption,
    takes_view_flags,
)
from vpltune.renderer.errors import InputError

if TYPE_CHECKING:
    from vpltune.renderer.config.artist_parameters import ArtistParameters
    from vpltune.renderer.config.tuned_config import TunedConfig
    from vpltune.renderer.frame.runtime import Runtime
    from vpltune.renderer.scene.light_motion import BouncingLights
    from vpltune.renderer.scene.scene import Scene
    from vpltune.renderer.scene.views import View

LARGEST_DYNAMIC_LIGHT_COUNT = 1_000_000
"""Most dynamic lights. A choice."""
DYNAMIC_LIGHT_SEED = 0
"""Seed of their positions and motion, fixed so that a command always draws the same image. A choice."""


@takes_view_flags
def render(
    scene: SceneArgument,
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            metavar="OUT",
            help="A .png for display, or a linear float32 .exr; with --frames, an .mp4 or a folder.",
        ),
    ],
    config: Annotated[
        str, typer.Option(metavar="FILE", help="A tuned config, `default` or `auto`.")
    ] = "default",
    layer: Annotated[Layer, typer.Option(help="Layer to write.")] = "final",
    size: ImageSizeOption = None,
    visibility: VisibilityOption = None,
    interleave: InterleaveOption = None,
    map_size: MapSizeOption = None,
    map_refinement: MapRefinementOption = None,
    rsm_resolution: RsmResolutionOption = None,
    bounces: BouncesOption = None,
    sky_lights: SkyLightsOption = None,
    dynamic_lights: Annotated[
        int,
        typer.Option(metavar="N", min=0, max=LARGEST_DYNAMIC_LIGHT_COUNT, help="Add N small moving lights."),
    ] = 0,
    frames: Annotated[int | None, typer.Option(metavar="N", min=1, help="Draw a clip of N frames.")] = None,
    fps: Annotated[float, typer.Option(metavar="F", help="Frames per second of the clip.")] = 30.0,
    motion: Annotated[
        Motion, typer.Option(help="What moves besides the scene's animation; auto: both if it has none.")
    ] = "auto",
    scale: Annotated[float, typer.Option(help="Scale scene, camera and light by this factor.")] = 1.0,
    views: ViewsFileOption = None,
    view: ViewNameOption = None,
    *,
    flags: ViewFlags,
    json: JsonOption = False,
) -> Report:
    """Draw a scene with a config, without a window."""
    from vpltune.cli.chosen_view import chosen_view
    from vpltune.cli.quality_flags import with_flags
    from vpltune.cli.render_clip import write_clip
    from vpltune.renderer.config.tuned_config import read_config
    from vpltune.renderer.files.atomic_file import require_writable
    from vpltune.renderer.files.image_file import require_extension
    from vpltune.renderer.files.video_file import check_clip_path

    # Check the flags before the scene is read.
    chosen = chosen_view(views, view, size, flags)
    if frames is None:
        require_extension(output, ".png", ".exr")
    else:
        check_clip_path(output, chosen.size)
    require_writable(output if frames is not None and not output.suffix else output.parent)
    if not (math.isfinite(fps) and 0.1 <= fps <= 1000.0):
        raise InputError(f"--fps: must lie in [0.1, 1000], got {fps}")
    factor = checked_scale(scale)
    tuned, overridden = with_flags(
        read_config(config),
        visibility=visibility,
        interleave=interleave,
        map_size=map_size,
        map_refinement=map_refinement,
        rsm_resolution=rsm_resolution,
        bounces=bounces,
        sky_lights=sky_lights,
    )
    warn(overridden)

    from vpltune.renderer.frame.runtime import Runtime
    from vpltune.renderer.scene.scene import scaled
    from vpltune.renderer.scene.sequence import Sequence
    from vpltune.renderer.scene.views import scaled_view

    loaded = chosen.read(scene)
    drawn = chosen.placed(loaded, scene)
    sequence = Sequence(loaded, drawn, motion, factor)
    if factor != 1.0:
        loaded, drawn = scaled(loaded, factor), scaled_view(drawn, factor)
    runtime = Runtime(loaded)
    detail(f"OpenGL on {runtime.opengl_renderer}")
    bouncing = _bouncing_lights(loaded, drawn, dynamic_lights)
    if frames is None:
        parameters = _write_layer(runtime, tuned, drawn, layer, output, bouncing)
    else:
        parameters = None
        write_clip(runtime, tuned, sequence, layer, output, frames, fps, bouncing)
    clip = {} if frames is None else {"frames": frames, "fps": fps}
    return _report(scene, output, layer, (parameters or tuned.parameters).as_dict(), drawn, clip)


def _bouncing_lights(scene: "Scene", view: "View", count: int) -> "BouncingLights | None":
    from vpltune.renderer.scene.light_motion import BouncingLights, flux_beside

    if not count:
        return None
    return BouncingLights(scene, count, DYNAMIC_LIGHT_SEED, flux_beside(scene, view.lights))


def _write_layer(
    runtime: "Runtime",
    config: "TunedConfig",
    view: "View",
    layer: Layer,
    output: Path,
    bouncing: "BouncingLights | None",
) -> "ArtistParameters":
    """Write one image, and return the parameters that it was drawn with."""
    from vpltune.renderer.files.image_file import write_exr, write_png
    from vpltune.renderer.frame.layer_display import for_display
    from vpltune.renderer.scene.dynamic_lights import DynamicLights

    lights = None if bouncing is None else DynamicLights(bouncing.records)
    if output.suffix.lower() == ".exr":
        # A linear file takes the radiance of the final image, without exposure and tone curve.
        pixels = (
            runtime.render_radiance(view, config, lights=lights)
            if layer == "final"
            else runtime.render(view, config, layer=layer, lights=lights)
        )
        write_exr(output, pixels, "Z" if layer == "depth" else "Y")
    else:
        pixels = runtime.render(view, config, layer=layer, lights=lights)
        write_png(output, for_display(runtime, layer, pixels))
    if config.auto is None:
        return config.parameters
    return runtime.draw(view, config, lights=lights).read_parameters()


def _report(
    scene: Path, output: Path, layer: Layer, parameters: dict, view: "View", clip: dict[str, int | float]
) -> Report:
    from rich.markup import escape

    from vpltune.renderer.scene.views import views_to_json

    document = {
        "scene": str(scene),
        "output": str(output),
        "layer": layer,
        "parameters": parameters,
        "view": views_to_json(str(scene), (view,))["views"][0],
        **clip,
        "status": "ok",
    }
    width, height = view.size
    length = f", {clip['frames']} frames" if clip else ""
    return Report(document, (f"wrote {escape(str(output))} ({layer}, {width}x{height}{length})",))
