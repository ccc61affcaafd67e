"""Frame timing: every pass is timed, the figures add up, and nothing is left behind."""

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from built_scenes import colored_room, room_view
from made_priors import made_prior

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame import frame_timing
from vpltune.renderer.frame.frame_timing import PassClock, frame_milliseconds, truthful_clock
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.dynamic_lights import DynamicLights, point_lights

PASSES = [
    "geometry",
    "light_pre_pass",
    "reflective_shadow_map",
    "vpl_importance",
    "virtual_point_lights",
    "direct_light",
    "receiver_bounds",
    "light_walks",
    "clustered_discs",
    "vpl_visibility_maps",
    "vpl_gather",
    "interleaved_filter",
    "material_resolve",
    "tone_mapping",
]
"""In the order in which a frame runs them."""

CONFIG = TunedConfig(ArtistParameters(vpl_count=64), quality=Quality(interleave=4, rsm_resolution=128))


@pytest.fixture
def runtime(gl_context) -> Runtime:
    return Runtime(colored_room(), RuntimeOptions(light_path="tiles"), context=gl_context)


def some_lights() -> DynamicLights:
    return DynamicLights(point_lights(np.zeros((10, 3)), np.full(3, 0.05), 0.5))


def test_every_pass_is_timed(runtime):
    milliseconds = runtime.pass_milliseconds(room_view(), CONFIG, frames=3, lights=some_lights())
    assert list(milliseconds) == PASSES
    assert all(value > 0.0 for value in milliseconds.values())


def without(*names: str) -> list[str]:
    return [name for name in PASSES if name not in names]


def with_before(name: str, *added: str) -> list[str]:
    place = PASSES.index(name)
    passes = (*PASSES[:place], *added, *PASSES[place:])
    return [each for each in passes if each != "light_pre_pass"]


def changed(**parameters) -> TunedConfig:
    return replace(CONFIG, parameters=replace(CONFIG.parameters, **parameters))


CASES = {
    "default": (CONFIG, without("light_pre_pass")),
    "no visibility maps": (
        CONFIG.seen_by("transmittance"),
        without("light_pre_pass", "receiver_bounds", "vpl_visibility_maps"),
    ),
    "full gather": (CONFIG.with_full_gather(), without("light_pre_pass", "interleaved_filter")),
    "one VPL is not interleaved": (
        replace(CONFIG, parameters=ArtistParameters(vpl_count=1)),
        without("light_pre_pass", "interleaved_filter"),
    ),
    "points, and discs of later light": (changed(lloyd_iterations=0), without("light_pre_pass")),
    "one bounce": (replace(CONFIG, light=ONE_BOUNCE), without("light_pre_pass", "light_walks")),
    "one bounce of points": (
        replace(changed(lloyd_iterations=0), light=ONE_BOUNCE),
        without("light_pre_pass", "light_walks", "clustered_discs"),
    ),
    "no importance": (changed(density_importance=0.0), without("light_pre_pass", "vpl_importance")),
    "near field of points": (
        changed(lloyd_iterations=0, screen_space_strength=1.0),
        with_before("material_resolve", "screen_space_indirect", "screen_space_filter"),
    ),
    "no near field of discs": (changed(screen_space_strength=1.0), without("light_pre_pass")),
    "prior": (
        replace(CONFIG, auto=made_prior()),
        with_before("vpl_gather", "scene_statistics", "auto_parameters"),
    ),
}


@pytest.mark.parametrize(("config", "names"), CASES.values(), ids=CASES)
def test_the_names_are_those_of_the_passes_that_ran(runtime, config, names):
    """In the order of the frame, and none for a pass that the config does not ask for."""
    assert list(runtime.pass_milliseconds(room_view("spot", (32, 24)), config, frames=1)) == names


def test_the_passes_add_up_to_the_frame(runtime, gl_context):
    """By the wall clock the passes are nearly all of a finished frame: at least half, and no more than it.

    Half, because uploads and Python between passes are not theirs; the room's image is large enough that
    they are little. Another program may come between the passes of a frame: one of ten has to be undisturbed.
    """
    drawn = runtime.draw(room_view(size=(256, 192)), CONFIG)
    gl_context.finish()
    clock = PassClock(gl_context, "wall")
    shares = []
    for _ in range(10):
        start = time.perf_counter()
        drawn.frame.draw(drawn.inputs, clock)
        drawn.frame.resolve((1.0, 1.0), None, clock)
        gl_context.finish()
        whole = 1e3 * (time.perf_counter() - start)
        clock.end_frame()
        passes = sum(clock._history[-1].values())
        assert passes <= whole
        shares.append(passes / whole)
    assert max(shares) > 0.5


def test_the_passes_are_roughly_the_whole_frame(runtime):
    """The runtime's own two figures: passes that are timed one by one do not overlap, so that they may take
    longer together, but not several times so long. Other programs may disturb either: three tries."""
    view = room_view()
    ratios = []
    for _ in range(3):
        passes = sum(runtime.pass_milliseconds(view, CONFIG, frames=3).values())
        ratios.append(passes / runtime.frame_milliseconds(view, CONFIG, frames=3))
        if 0.5 < ratios[-1] < 2.0:
            return
    pytest.fail(f"passes over frame: {ratios}")


def test_a_timed_frame_is_left_as_it_was(runtime):
    view = room_view()
    before = runtime.render(view, CONFIG)
    runtime.pass_milliseconds(view, CONFIG, frames=2, lights=some_lights())
    np.testing.assert_array_equal(runtime.render(view, CONFIG), before)


@pytest.mark.parametrize("kind", ["gpu", "wall"])
def test_timed_and_untimed_frames_are_the_same(runtime, gl_context, kind):
    drawn = runtime.draw(room_view(), CONFIG)
    before = drawn.display.read()
    clock = PassClock(gl_context, kind)
    drawn.frame.draw(drawn.inputs, clock)
    drawn.frame.resolve((1.0, 1.0), None, clock)
    clock.end_frame()
    assert drawn.display.read() == before


@pytest.mark.parametrize("kind", ["gpu", "wall"])
def test_a_failing_pass_leaves_the_clock_usable(gl_context, kind):
    clock = PassClock(gl_context, kind)
    with pytest.raises(ZeroDivisionError), clock.timed("failing"):
        raise ZeroDivisionError
    with clock.timed("failing"), pytest.raises(ValueError, match="no frame has ended yet"):
        clock.milliseconds()
    clock.end_frame()
    assert list(clock.milliseconds()) == ["failing"]
    assert gl_context.error == "GL_NO_ERROR"


def test_steps_of_one_name_are_added_and_frames_are_compared_by_their_median(gl_context, monkeypatch):
    now = iter([0.0, 1.0, 1.0, 3.0, 3.0, 10.0, 10.0, 14.0, 20.0, 25.0, 30.0, 100.0])
    monkeypatch.setattr(frame_timing, "time", SimpleNamespace(perf_counter=lambda: next(now)))
    clock = PassClock(gl_context, "wall")
    for names in (("a", "a", "b"), ("a",), ("b", "a")):
        for name in names:
            with clock.timed(name):
                pass
        clock.end_frame()
    # a: 1 + 2, 4 and 70 seconds; b: 7, not at all and 5.
    assert clock.milliseconds() == {"a": pytest.approx(4000.0), "b": pytest.approx(5000.0)}


def test_queries_are_used_again(runtime, gl_context, monkeypatch):
    """With GPU timers, a second frame makes no new query; each gives a time."""
    drawn = runtime.draw(room_view(), CONFIG)
    made = []
    original = type(gl_context).query

    def counted(self, **kinds):
        made.append(kinds)
        return original(self, **kinds)

    monkeypatch.setattr(type(gl_context), "query", counted)
    clock = PassClock(gl_context, "gpu")
    for _ in range(4):
        drawn.frame.draw(drawn.inputs, clock)
        drawn.frame.resolve((1.0, 1.0), None, clock)
        clock.end_frame()
    # The gather and the VPLs run twice, and clustering once for each of two pools, which are then joined.
    assert 0 < len(made) <= len(PASSES) + 4
    milliseconds = clock.milliseconds()
    assert list(milliseconds) == without("light_pre_pass")
    assert all(value > 0.0 for value in milliseconds.values())


def test_software_renderers_are_timed_by_the_wall_clock():
    assert truthful_clock("llvmpipe (LLVM 15.0.6, 256 bits)") == "wall"
    assert truthful_clock("NVIDIA H100 80GB HBM3/PCIe/SSE2") == "gpu"


def test_no_figures_without_a_frame(gl_context):
    with pytest.raises(ValueError, match="no frame has ended yet"):
        PassClock(gl_context).milliseconds()


@pytest.mark.parametrize(("clock", "least"), [("gpu", 0.0), ("wall", 1.9)])
def test_a_whole_frame_is_drawn_as_often_as_asked(gl_context, clock, least):
    """What the processor does meanwhile is part of it by the wall clock alone."""
    drawn = []
    milliseconds = frame_milliseconds(gl_context, lambda: drawn.append(time.sleep(0.002)), 3, clock)
    assert len(drawn) == 3
    assert milliseconds >= least
