"""Processor time of frames that a software renderer draws: other load on the machine does not count."""

import time
from collections.abc import Mapping
from statistics import median

from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import MachineError
from vpltune.renderer.frame.frame_timing import truthful_clock
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.views import View

Drawing = tuple[Runtime, View, TunedConfig]
"""What is drawn, and with what."""


def check_software(runtime: Runtime, benchmark: str) -> None:
    """Raise MachineError, naming the benchmark, where a GPU draws: no processor time is its own."""
    if truthful_clock(runtime.opengl_renderer) == "gpu":
        raise MachineError(
            f"{benchmark}: frames must be drawn by a software renderer, got {runtime.opengl_renderer}; "
            "try: LIBGL_ALWAYS_SOFTWARE=1"
        )


def frame_seconds(runtime: Runtime, view: View, config: TunedConfig) -> float:
    """Processor seconds of one frame, of all threads, until it is finished."""
    runtime.context.finish()
    start = time.process_time()
    runtime.draw(view, config)
    runtime.context.finish()
    return time.process_time() - start


def seconds_in_turn(drawings: Mapping[str, Drawing], repeats: int) -> dict[str, float]:
    """Median processor seconds of a frame of each drawing: all are drawn in turn, `repeats` times.

    A drawing's first frame, which compiles its programs, does not count.
    """
    taken: dict[str, list[float]] = {name: [] for name in drawings}
    for _ in range(1 + repeats):
        for name, drawing in drawings.items():
            taken[name].append(frame_seconds(*drawing))
    return {name: median(seconds[1:]) for name, seconds in taken.items()}
