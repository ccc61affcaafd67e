"""The light pre-pass against one full-screen draw for each light, and the CPU time of a frame in Python."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from unittest import mock

import moderngl
import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import own_scene, scene_and_view
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import DrawnFrame, Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.light_motion import BouncingLights, flux_beside
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View
from vpltune.renderer.techniques.light_per_draw import LightPerDrawPass

SIZE = (640, 360)
"""Width and height of the image in pixels. A choice: a ninth of 1080p, for software renderers."""
COUNTS = (1_000, 10_000, 100_000)
"""Dynamic lights. A choice."""
RANGE = 1.0 / 40.0
"""Range of every point light in diagonals of the scene; spots reach twice as far. A choice: the same for all
counts, so that ten times the lights are ten times the work."""
PER_DRAW_LIGHTS = 1_000
"""Lights that are drawn one by one; their time is scaled to the other counts. A choice."""
WARM_UP_LIGHTS = 10
"""Lights of an untimed draw before. A choice."""
FRAME_SECONDS = 1.0 / 60.0
"""Seconds that the moving lights advance in a frame: 60 frames per second."""
PYTHON_FRAMES = 20
"""Frames of a batch that is timed as a whole. A choice."""
PYTHON_BATCHES = 20
"""Batches, of which the fastest counts. A choice."""
PYTHON_LIMIT_MS = 1.0
"""Milliseconds of Python in a frame. A choice: a sixteenth of a frame at 60 frames per second."""
PRE_PASS_CONFIG = TunedConfig(
    ArtistParameters(vpl_count=1), visibility="transmittance", quality=Quality(rsm_resolution=64)
)
"""As little beside the light pre-pass as a frame can have."""


def light_rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Milliseconds of the light pre-pass for each count, and of a frame's Python code."""
    scene, view = scene_and_view(own_scene("gallery"), SIZE)
    runtime = Runtime(scene)
    progress("one draw for each light", 0.0)
    per_draw = _per_draw_milliseconds(runtime, view, _moving_lights(scene, view, PER_DRAW_LIGHTS))
    rows = []
    for index, count in enumerate(COUNTS):
        progress(f"{count} lights", (1 + index) / (2 + len(COUNTS)))
        rows.append(_row(runtime, view, _moving_lights(scene, view, count), per_draw))
    progress("Python per frame", (1 + len(COUNTS)) / (2 + len(COUNTS)))
    return [*rows, _python_row(scene, view)]


def _moving_lights(scene: Scene, view: View, count: int) -> BouncingLights:
    low, high = scene.bounds()
    reach = RANGE * float(np.linalg.norm(high - low))
    return BouncingLights(scene, count, 0, flux_beside(scene, view.lights), reach)


def _drawn(runtime: Runtime, view: View, moving: BouncingLights) -> DrawnFrame:
    return runtime.draw(view, PRE_PASS_CONFIG, lights=DynamicLights(moving.records))


def _per_draw_milliseconds(runtime: Runtime, view: View, moving: BouncingLights) -> float:
    """Milliseconds of a light that is drawn over the whole image by itself."""
    drawn = _drawn(runtime, view, moving)
    light_pass, context = LightPerDrawPass(drawn.frame.resources), runtime.context
    light_pass.draw(replace(drawn.inputs, dynamic_lights=DynamicLights(moving.records[:WARM_UP_LIGHTS])))
    context.finish()
    start = time.perf_counter()
    light_pass.draw(drawn.inputs)
    context.finish()
    return 1e3 * (time.perf_counter() - start) / len(moving.records)


def _row(runtime: Runtime, view: View, moving: BouncingLights, per_draw: float) -> Row:
    """The faster of volumes and tiles, as the runtime measures both before it chooses one."""
    count = len(moving.records)
    milliseconds = _drawn(runtime, view, moving).frame.light_pre_pass.milliseconds
    measured = milliseconds[(count - 1).bit_length()]
    path = min(measured, key=lambda name: measured[name])
    how = "measured" if count == PER_DRAW_LIGHTS else f"extrapolated from {PER_DRAW_LIGHTS}"
    other = ", ".join(f"{name} {taken:.3g} ms" for name, taken in measured.items())
    against = f"one draw per light, {how} ({path} chosen: {other})"
    return Row(f"lights_{count}", measured[path], "ms", against, per_draw * count)


def _python_row(scene: Scene, view: View) -> Row:
    """The CPU time of a whole frame with moving lights, where every draw, dispatch and clear does nothing."""
    config = TunedConfig(quality=Quality(interleave=4))
    runtime = Runtime(scene, RuntimeOptions(light_path="tiles"))
    moving = _moving_lights(scene, view, PER_DRAW_LIGHTS)
    lights = DynamicLights(moving.records)

    def one_frame() -> None:
        moving.advance(FRAME_SECONDS)
        lights.update(moving.records)
        runtime.draw(view, config, lights=lights)

    one_frame()
    durations = []
    with ExitStack() as patches:
        for owner, names in (
            (moderngl.ComputeShader, ("run", "run_indirect")),
            (moderngl.VertexArray, ("render", "render_indirect")),
            (moderngl.Framebuffer, ("clear",)),
        ):
            for name in names:
                patches.enter_context(mock.patch.object(owner, name, lambda *arguments, **keywords: None))
        for _ in range(PYTHON_BATCHES):
            start = time.perf_counter()
            for _ in range(PYTHON_FRAMES):
                one_frame()
            durations.append(1e3 * (time.perf_counter() - start) / PYTHON_FRAMES)
    against = "limit; visibility maps, draws and dispatches left out, 1,000 lights moved and uploaded"
    return Row("python_per_frame", min(durations), "ms", against, PYTHON_LIMIT_MS)
