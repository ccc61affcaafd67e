"""The gather against a draw for each VPL, placement against a read-back, and Python's part of a frame."""

import time
from collections.abc import Iterator
from contextlib import ExitStack
from unittest import mock

import moderngl

from benchmarks.harness.row import Row
from benchmarks.speed.gpu_frames import SIZES, MeasuredScene
from benchmarks.speed.gpu_lights import moving_lights
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.frame_timing import frame_milliseconds
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.techniques.vpls_readback import VplsReadback

SIZE = "720p"
VPL_COUNT = 1024
"""VPLs of placement and gather. A choice."""
READBACK_DRAWS = 128
"""VPLs that are drawn one by one; their time is scaled to `VPL_COUNT`. A choice."""
WARM_UP_DRAWS = 4
"""VPLs of an untimed draw before. A choice."""
FRAME_SECONDS = 1.0 / 60.0
"""Seconds that the moving lights advance in a frame: 60 frames per second."""
PYTHON_LIGHTS = 1_000
"""Dynamic lights of the frame whose Python is timed. A choice."""
PYTHON_FRAMES = 20
"""Frames of a batch that is timed as a whole. A choice."""
PYTHON_BATCHES = 20
"""Batches, of which the fastest counts. A choice."""
PYTHON_LIMIT_MS = 1.0
"""Milliseconds of Python in a frame. A choice: a sixteenth of a frame at 60 frames per second."""


def alternative_rows(measured: MeasuredScene) -> Iterator[Row]:
    """The gather against a draw for each VPL, placement against a read-back, and Python's part of a frame."""
    points = ArtistParameters(vpl_count=VPL_COUNT, lloyd_iterations=0, density_importance=0.0)
    config = TunedConfig(points, visibility="transmittance", quality=Quality(interleave=1), light=ONE_BOUNCE)
    drawn = measured.runtime().draw(measured.sized(SIZES[SIZE]), config)
    milliseconds = measured.pass_milliseconds(drawn)
    context = measured.context
    readback = VplsReadback(drawn.frame, VPL_COUNT)
    context.finish()
    start = time.perf_counter()
    texels = readback.read()
    read = time.perf_counter()
    vpls = readback.place(texels, drawn.inputs.records)
    placed = time.perf_counter()
    yield Row(
        f"vpls.{SIZE}.placement",
        milliseconds["virtual_point_lights"],
        "ms",
        f"RSM read back in {1e3 * (read - start):.3g} ms, and placed on the processor",
        1e3 * (placed - start),
    )
    readback.draw(drawn.inputs, vpls[:WARM_UP_DRAWS])
    draws = frame_milliseconds(
        context, lambda: readback.draw(drawn.inputs, vpls[:READBACK_DRAWS]), 1, measured.rates.clock
    )
    yield Row(
        f"vpls.{SIZE}.gather",
        milliseconds["vpl_gather"],
        "ms",
        f"one additive draw per VPL, from {READBACK_DRAWS}, without maps",
        draws * VPL_COUNT / READBACK_DRAWS,
    )
    yield python_row(measured)


def python_row(measured: MeasuredScene) -> Row:
    """CPU time of the default frame with moving lights, where every draw, dispatch and clear does nothing."""
    config = TunedConfig(light=ONE_BOUNCE)
    runtime = measured.runtime(RuntimeOptions(light_path="tiles"))
    moving = moving_lights(measured, PYTHON_LIGHTS)
    lights = DynamicLights(moving.records)
    view = measured.sized(SIZES[SIZE])

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
    against = f"limit; draws and dispatches left out, {PYTHON_LIGHTS:,} lights moved and uploaded"
    return Row("python.per_frame", min(durations), "ms", against, PYTHON_LIMIT_MS)
