"""Light pre-pass: many dynamic lights against one full-screen draw for each, and Python's part of a frame."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from unittest import mock

import moderngl
import numpy as np

from benchmarks.harness.row import Row
from vpltune import configs
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.frame import Frame, frame_light_records
from vpltune.renderer.frame.light_pre_pass import LightPrePass
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.gpu.dynamic_light_buffer import DynamicLightBuffer
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.light_motion import BouncingLights, flux_beside
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View
from vpltune.renderer.techniques.light_per_draw import LightPerDrawPass

SIZE = (640, 360)
COUNTS = (1_000, 10_000, 100_000)
RANGE = 1.0 / 40.0
"""Of every point light, in diagonals of the scene, for every count: ten times the lights are ten times the
work. Spots reach twice as far."""
PER_DRAW_LIGHTS = 1_000
FRAME_SECONDS = 1.0 / 60.0
PYTHON_FRAMES = 20
PYTHON_BATCHES = 20
PYTHON_LIMIT_MS = 1.0


def light_rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Rows of the light pre-pass; milliseconds by the wall clock until the GPU has finished."""
    path = Path(configs.__file__).parent / "scenes" / "gallery.glb"
    scene = read_scene(path)
    camera, lights, _ = resolve_camera_and_lights(scene, path, None, None)
    view = View("lights", "fitted", SIZE, camera, lights)
    context = create_context()
    buffers = SceneBuffers(context, scene)
    records = frame_light_records(buffers, view)
    frame = Frame(context, buffers, SIZE, 64, len(records.faces), 1, RuntimeOptions())
    frame.draw(view, records, ArtistParameters(vpl_count=1))

    progress("one draw for each light", 0.0)
    per_draw = _per_draw_milliseconds(context, frame, view, _moving_lights(scene, view, PER_DRAW_LIGHTS))
    rows = []
    for index, count in enumerate(COUNTS):
        progress(f"{count} lights", (1 + index) / (2 + len(COUNTS)))
        rows.append(_row(frame, view, _moving_lights(scene, view, count), per_draw))
    progress("Python per frame", (1 + len(COUNTS)) / (2 + len(COUNTS)))
    return [*rows, _python_row(scene, view)]


def _moving_lights(scene: Scene, view: View, count: int) -> BouncingLights:
    low, high = scene.bounds()
    reach = RANGE * float(np.linalg.norm(high - low))
    return BouncingLights(scene, count, 0, flux_beside(scene, view.lights), reach)


def _per_draw_milliseconds(
    context: moderngl.Context, frame: Frame, view: View, moving: BouncingLights
) -> float:
    """Milliseconds for each light, drawn over the whole image by itself."""
    lights, buffer = DynamicLights(moving.records), DynamicLightBuffer(context)
    buffer.upload(lights)
    light_pass, camera = LightPerDrawPass(context, frame.gbuffer), frame.camera(view)
    light_pass.draw(camera, DynamicLights(moving.records[:10]))
    context.finish()
    start = time.perf_counter()
    light_pass.draw(camera, lights)
    context.finish()
    return 1e3 * (time.perf_counter() - start) / len(lights)


def _row(frame: Frame, view: View, moving: BouncingLights, per_draw: float) -> Row:
    """Both ways, measured as the runtime does when it chooses; the figure is that of the one it takes."""
    pre_pass: LightPrePass = frame.light_pre_pass
    lights, count = DynamicLights(moving.records), len(moving.records)
    pre_pass.draw(frame.camera(view), lights)
    measured = pre_pass.milliseconds[(count - 1).bit_length()]
    path = min(measured, key=lambda name: measured[name])
    how = "measured" if count == PER_DRAW_LIGHTS else f"extrapolated from {PER_DRAW_LIGHTS}"
    other = ", ".join(f"{name} {milliseconds:.3g} ms" for name, milliseconds in measured.items())
    against = f"one draw per light, {how} ({path} chosen: {other})"
    return Row(f"lights_{count}", measured[path], "ms", against, per_draw * count)


def _python_row(scene: Scene, view: View) -> Row:
    """A whole frame with 1,000 moving lights in which every draw, dispatch and clear is left out."""
    config = TunedConfig(visibility="maps")
    runtime = Runtime(scene, config, RuntimeOptions(interleave=4, light_path="tiles"))
    moving = _moving_lights(scene, view, PER_DRAW_LIGHTS)
    lights = DynamicLights(moving.records)

    def one_frame() -> None:
        moving.advance(FRAME_SECONDS)
        lights.update(moving.records)
        runtime.draw(view, lights=lights)

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
