"""`vpltune render --frames`: the frames of a clip, drawn and written one by one."""

from pathlib import Path

import numpy as np

from vpltune.cli.layer_display import for_display
from vpltune.cli.options import Layer
from vpltune.cli.progress_display import shown_progress
from vpltune.renderer.files.video_file import clip_writer
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.light_motion import BouncingLights
from vpltune.renderer.scene.sequence import Sequence

_EXPOSED = ("final", "direct", "indirect", "irradiance")


def write_clip(
    runtime: Runtime,
    sequence: Sequence,
    layer: Layer,
    output: Path,
    frame_count: int,
    fps: float,
    bouncing: BouncingLights | None,
) -> None:
    """Write the frames at times 0, 1/fps, 2/fps, …; all have the exposure of the first."""
    lights = None if bouncing is None else DynamicLights(bouncing.records)
    exposure = None
    size = sequence.at(0.0).view.size
    with shown_progress() as progress, clip_writer(output, size, fps) as write:
        for frame in range(frame_count):
            progress("frames", frame / frame_count)
            moment = sequence.at(frame / fps)
            runtime.pose(moment.pose)
            pixels = runtime.render(moment.view, layer, exposure, lights)
            shown = for_display(runtime, layer, pixels, exposure)
            write(shown if shown.dtype == np.uint8 else _bytes(shown))
            if exposure is None and layer in _EXPOSED:
                exposure = runtime.exposure()
            if bouncing is not None and lights is not None:
                bouncing.advance(1.0 / fps)
                lights.update(bouncing.records)
        progress("frames", 1.0)


def _bytes(image: np.ndarray) -> np.ndarray:
    return np.round(np.clip(image, 0.0, 1.0) * 255.0).astype(np.uint8)
