"""The real-time table: limits are what must be moved and computed, and slow rows are left out."""

import math

import numpy as np
import pytest
from built_scenes import colored_room, room_view

import benchmarks.speed.gpu_alternatives as gpu_alternatives
import benchmarks.speed.gpu_frames as gpu_frames
import benchmarks.speed.gpu_lights as gpu_lights
from benchmarks.harness.machine_rates import MachineRates, measured_rates
from benchmarks.speed.frame_limits import lights_per_pixel, pass_bytes, pass_limits, pass_operations
from benchmarks.speed.gpu_frames import MeasuredScene, Series, Timing, frame_count, frame_rows, pass_rows
from benchmarks.speed.surrogate import FLOPS_PER_PAIR
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.dynamic_lights import DynamicLights, point_lights

SIZE = (32, 24)
RATES = MachineRates(1e9, 1e9, "wall")
PLAIN = TunedConfig(
    ArtistParameters(vpl_count=16, lloyd_iterations=0),
    visibility="transmittance",
    quality=Quality(interleave=1, rsm_resolution=64),
    light=ONE_BOUNCE,
)


@pytest.fixture
def runtime(gl_context) -> Runtime:
    return Runtime(colored_room(), context=gl_context)


def test_the_longer_of_arithmetic_and_memory_rules():
    assert RATES.milliseconds(2e6, 1e6) == 2.0
    assert RATES.milliseconds(1e6, 3e6) == 3.0


def test_rates_are_positive_and_a_software_renderer_is_timed_by_the_wall_clock(gl_context):
    rates = measured_rates(gl_context)
    assert rates.operations_per_second > 0.0
    assert rates.bytes_per_second > 0.0
    assert rates.clock == "wall" or "llvmpipe" not in gl_context.info["GL_RENDERER"]


def test_bytes_of_a_pass_are_those_of_its_targets(runtime):
    """Tone mapping reads radiance (16 bytes a pixel) and writes 4; geometry writes 4 + 4 + 8."""
    moved = pass_bytes(runtime.draw(room_view(size=SIZE), PLAIN))
    pixels = SIZE[0] * SIZE[1]
    assert next(iter(moved)) == "geometry"
    assert moved["tone_mapping"] == pytest.approx(20 * pixels, abs=64)
    assert 16 * pixels <= moved["geometry"] < 16 * pixels + 1e5


def test_operations_of_the_gather_are_counted_by_pair(runtime):
    drawn = runtime.draw(room_view(size=SIZE), PLAIN)
    assert pass_operations(drawn, PLAIN, 100)["vpl_gather"] == 32 * 24 * 16 * FLOPS_PER_PAIR
    shared = TunedConfig(
        PLAIN.parameters,
        visibility="transmittance",
        quality=Quality(interleave=4, rsm_resolution=64),
        light=ONE_BOUNCE,
    )
    drawn = runtime.draw(room_view(size=SIZE), shared)
    assert pass_operations(drawn, shared, 100)["vpl_gather"] == 32 * 24 * FLOPS_PER_PAIR
    assert set(pass_limits(drawn, shared, 100, RATES)) == set(pass_bytes(drawn))


def test_lights_whose_range_covers_the_room_all_count(runtime):
    """Seven lights that reach everything count seven at every pixel with a surface; ones far away, none."""
    everywhere = point_lights(np.zeros((7, 3)), np.full(3, 0.1), 1e3)
    far = point_lights(np.full((5, 3), 1e4), np.full(3, 0.1), 1.0)
    lights = DynamicLights(np.concatenate([everywhere, far]))
    drawn = runtime.draw(room_view(size=SIZE), PLAIN, lights=lights)
    seen = drawn.capture(maps=False).valid.mean()
    assert lights_per_pixel(drawn) == pytest.approx(7.0 * seen)


def test_rows_that_would_take_too_long_are_left_out_and_say_so():
    """By the line through the last two: 1 s for 64, 4 s for 256, hence 16 s for 1,024."""
    series = Series(Timing(row_seconds=20.0))
    assert not series.too_long(64)
    series.note(64, 1e3)
    assert not series.too_long(256)
    series.note(256, 4e3)
    assert series.expected(1024) == pytest.approx(16e3)
    assert series.too_long(1024)
    row = series.left_out("frame", 1024)
    assert math.isnan(row.value)
    assert row.against == "left out: a frame would take 16 s; the limit of a row"


def test_slow_frames_are_timed_less_often():
    timing = Timing(row_seconds=10.0, frames=5)
    assert [timing.frames_for(ms) for ms in (1.0, 3e3, 1e5)] == [5, 3, 1]


@pytest.mark.slow
def test_rows_of_a_small_table(gl_context, monkeypatch):
    """Each pass and each frame has a row beside its limit."""
    monkeypatch.setattr(gpu_frames, "SIZES", {"1080p": SIZE})
    monkeypatch.setattr(gpu_frames, "COUNTS", (4, 16))
    monkeypatch.setattr(
        gpu_frames, "PASS_CONFIG", TunedConfig(ArtistParameters(vpl_count=16), light=ONE_BOUNCE)
    )
    measured = measured_room(gl_context)
    passes = {row.name: row for row in pass_rows(measured)}
    assert {"pass.1080p.maps.vpl_visibility_maps", "pass.1080p.transmittance.vpl_gather"} < set(passes)
    assert "pass.1080p.transmittance.vpl_visibility_maps" not in passes
    frames = list(frame_rows(measured))
    assert len(frames) == frame_count() == 8
    assert frames[0].name == "frame.1080p.4_points.full"
    assert frames[-1].name == "frame.1080p.16_discs.interleaved"
    assert all(row.value > 0.0 and row.against_value > 0.0 for row in (*passes.values(), *frames))


def measured_room(gl_context) -> MeasuredScene:
    return MeasuredScene(colored_room(), room_view(), gl_context, RATES, Timing(frames=1))


def test_rows_of_few_lights(gl_context, monkeypatch):
    """A row for each path and count, and the cost of one light in tiles beside a draw of its own."""
    monkeypatch.setattr(gpu_lights, "SIZES", {"1080p": SIZE})
    monkeypatch.setattr(gpu_lights, "LIGHT_COUNTS", (2, 4, 8))
    monkeypatch.setattr(gpu_lights, "PER_DRAW_LIGHTS", 12)
    rows = list(gpu_lights.light_rows(measured_room(gl_context)))
    names = [f"lights.1080p.{count}_{path}" for path in ("tiles", "volumes") for count in (2, 4, 8)]
    assert [row.name for row in rows] == [*names, "lights.1080p.per_light_tiles"]
    assert len(rows) == gpu_lights.LIGHT_ROWS
    assert all(row.value > 0.0 and row.against_value > 0.0 and row.unit == "ms" for row in rows)
    assert rows[-1].value == rows[2].value / 8


def test_rows_of_alternatives(gl_context, monkeypatch):
    """Placement, gather and Python's part; the latter's limit is no measurement."""
    monkeypatch.setattr(gpu_alternatives, "SIZES", {"720p": SIZE})
    for name, value in {"VPL_COUNT": 16, "READBACK_DRAWS": 8, "PYTHON_LIGHTS": 8}.items():
        monkeypatch.setattr(gpu_alternatives, name, value)
    for name in ("PYTHON_FRAMES", "PYTHON_BATCHES"):
        monkeypatch.setattr(gpu_alternatives, name, 2)
    rows = {row.name: row for row in gpu_alternatives.alternative_rows(measured_room(gl_context))}
    assert list(rows) == ["vpls.720p.placement", "vpls.720p.gather", "python.per_frame"]
    assert all(row.value > 0.0 and row.against_value > 0.0 and row.unit == "ms" for row in rows.values())
    assert "from 8," in rows["vpls.720p.gather"].against
    assert rows["python.per_frame"].against_value == gpu_alternatives.PYTHON_LIMIT_MS
