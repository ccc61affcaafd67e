"""`vpltune render --frames`: draws and writes the frames of a clip one by one."""

from pathlib import Path

import numpy as np

from vpltune.cli.options import Layer
from vpltune.cli.progress_display import shown_progress
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.video_file import clip_writer
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.frame.layer_display import for_display
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.light_motion import BouncingLights
from vpltune.renderer.scene.sequence import Sequence
from vpltune.renderer.scene.views import View


def write_clip(
    runtime: Runtime,
    config: TunedConfig,
    sequence: Sequence,
    layer: Layer,
    output: Path,
    frame_count: int,
    fps: float,
    bouncing: BouncingLights | None,
) -> None:
    """Write a clip: frames at the times 0, 1/fps, 2/fps, … seconds, all with the exposure of the first.

    Args:
        runtime: draws the scene; its pose is changed.
        config: the config to draw with.
        sequence: pose and view at each time.
        layer: the layer to write.
        output: an .mp4, or a folder for .png files.
        frame_count: number of frames.
        fps: frames per second.
        bouncing: dynamic lights, moved from frame to frame; None for none.

    Raises:
        InputError: the output cannot be written to.
        MachineError: the GPU ran out of memory or reported an error.
    """
    state = ClipState()
    lights = None if bouncing is None else DynamicLights(bouncing.records)
    first = sequence.at(0.0)
    runtime.pose(first.pose)
    exposure = _exposure(runtime, config, first.view, layer, lights)
    with shown_progress() as progress, clip_writer(output, first.view.size, fps) as write:
        for frame in range(frame_count):
            progress("frames", frame / frame_count)
            moment = sequence.at(frame / fps)
            runtime.pose(moment.pose)
            pixels = runtime.render(moment.view, config, state, layer=layer, exposure=exposure, lights=lights)
            shown = for_display(runtime, layer, pixels, exposure)
            write(shown if shown.dtype == np.uint8 else _bytes(shown))
            if bouncing is not None and lights is not None:
                bouncing.advance(1.0 / fps)
                lights.update(bouncing.records)
        progress("frames", 1.0)


def _exposure(
    runtime: Runtime, config: TunedConfig, view: View, layer: Layer, lights: DynamicLights | None
) -> float | None:
    """The exposure that a view is displayed with; None for layers without exposure."""
    if layer == "final":
        return runtime.draw(view, config, lights=lights).read_exposure()
    if layer in ("direct", "indirect", "irradiance"):
        return runtime.measured_exposure(runtime.render(view, config, layer=layer, lights=lights))
    return None


def _bytes(image: np.ndarray) -> np.ndarray:
    return np.round(np.clip(image, 0.0, 1.0) * 255.0).astype(np.uint8)
