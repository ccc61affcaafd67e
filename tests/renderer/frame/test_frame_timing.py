"""Frame timing: every pass is timed, the figures add up, and nothing is left behind."""

import time

import numpy as np
import pytest
from built_scenes import colored_room, room_view

from vpltune.renderer.frame.frame import frame_light_records
from vpltune.renderer.frame.frame_timing import FrameTiming, truthful_clock
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.dynamic_lights import DynamicLights, point_lights

PASSES = {
    "geometry",
    "light_pre_pass",
    "reflective_shadow_map",
    "virtual_point_lights",
    "vpl_visibility_maps",
    "direct_light",
    "vpl_gather",
    "interleaved_filter",
    "material_resolve",
    "tone_mapping",
}


@pytest.fixture
def runtime(gl_context) -> Runtime:
    options = RuntimeOptions(interleave=4, light_path="tiles")
    return Runtime(colored_room(), "default", options, context=gl_context, rsm_resolution=128)


def some_lights() -> DynamicLights:
    return DynamicLights(point_lights(np.zeros((10, 3)), np.full(3, 0.05), 0.5))


def test_every_pass_is_timed(runtime):
    milliseconds = runtime.pass_milliseconds(room_view(), frames=3, lights=some_lights())
    assert set(milliseconds) == PASSES
    assert all(value > 0.0 for value in milliseconds.values())


def test_the_passes_add_up_to_the_frame(runtime, gl_context):
    """By the wall clock the passes are nearly all of a finished frame: at least half, and no more than it.

    Half, because uploads and Python between passes are not theirs; the room's image is large enough that
    they are little.
    """
    view = room_view(size=(256, 192))
    frame = runtime._draw(view)
    gl_context.finish()
    records = frame_light_records(runtime.scene_buffers, view)
    with FrameTiming(gl_context, frame, "wall") as timing:
        for _ in range(3):
            start = time.perf_counter()
            frame.draw(view, records, runtime.parameters)
            gl_context.finish()
            whole = 1e3 * (time.perf_counter() - start)
            timing.end_frame()
            passes = sum(timing._history[-1].values())
            assert 0.5 * whole < passes <= whole


def test_a_timed_frame_is_left_as_it_was(runtime):
    view = room_view()
    before = runtime.render(view)
    frame = runtime._draw(view)
    attributes = {name: dict(vars(value)) for name, value in vars(frame).items() if hasattr(value, "draw")}
    runtime.pass_milliseconds(view, frames=2)
    for name, was in attributes.items():
        assert vars(getattr(frame, name)).keys() == was.keys()
    np.testing.assert_array_equal(runtime.render(view), before)


def test_a_failing_frame_is_unwrapped_too(runtime, gl_context):
    frame = runtime._draw(room_view())
    with pytest.raises(ZeroDivisionError), FrameTiming(gl_context, frame):
        raise ZeroDivisionError
    assert "draw" not in vars(frame._geometry)


def test_queries_are_used_again(runtime, gl_context, monkeypatch):
    """With GPU timers, a second frame makes no new query; each gives a time."""
    view = room_view()
    frame = runtime._draw(view)
    records = frame_light_records(runtime.scene_buffers, view)
    made = []
    original = type(gl_context).query

    def counted(self, **kinds):
        made.append(kinds)
        return original(self, **kinds)

    monkeypatch.setattr(type(gl_context), "query", counted)
    with FrameTiming(gl_context, frame, "gpu") as timing:
        for _ in range(4):
            frame.draw(view, records, runtime.parameters)
            timing.end_frame()
    assert 0 < len(made) <= len(PASSES) + 1  # the gather runs twice
    assert all(value > 0.0 for value in timing.milliseconds().values())


def test_software_renderers_are_timed_by_the_wall_clock():
    assert truthful_clock("llvmpipe (LLVM 15.0.6, 256 bits)") == "wall"
    assert truthful_clock("NVIDIA H100 80GB HBM3/PCIe/SSE2") == "gpu"


def test_no_figures_without_a_frame(runtime, gl_context):
    frame = runtime._draw(room_view())
    with pytest.raises(ValueError, match="no frame has ended yet"):
        FrameTiming(gl_context, frame).milliseconds()
