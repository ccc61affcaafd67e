"""Drawing is a function: equal arguments give equal images to the last bit, whatever was drawn between."""

import gc
import weakref
from dataclasses import replace

import moderngl
import numpy as np
import pytest
from built_scenes import colored_room, room_view
from made_priors import made_prior
from point_vpls import point_vpls

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.parameter_block import BLOCK_BYTES
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import FitNote, TunedConfig
from vpltune.renderer.errors import MachineError
from vpltune.renderer.frame.frame import FrameSetup
from vpltune.renderer.frame.runtime import KEPT_FRAMES, LAYERS, Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.gpu.gpu_context import free_dropped
from vpltune.renderer.scene.animation import Pose
from vpltune.renderer.scene.dynamic_lights import DynamicLights, point_lights

SIZE = (24, 18)
VIEW = room_view("spot", SIZE)
QUALITY = Quality(map_size=8, rsm_resolution=64)
PLAIN = TunedConfig(point_vpls(vpl_count=64), quality=QUALITY, light=ONE_BOUNCE)
LIGHTS = DynamicLights(point_lights(np.array([[0.2, 0.3, 0.4]]), np.full(3, 0.3), 1.5))


def with_parameters(**changes) -> TunedConfig:
    return replace(PLAIN, parameters=replace(PLAIN.parameters, **changes))


def with_quality(**changes) -> TunedConfig:
    return replace(PLAIN, quality=replace(QUALITY, **changes))


CONFIGS = {
    "plain": PLAIN,
    "default": TunedConfig(ArtistParameters(vpl_count=64), quality=QUALITY, light=ONE_BOUNCE),
    "brighter": with_parameters(intensity=2.0),
    "softer": with_parameters(falloff_footprint=4.0, extinction_coefficient=0.5),
    "other maps": with_parameters(visibility_bias=0.05, visibility_softness=0.4),
    "more VPLs": with_parameters(vpl_count=96),
    "by importance": with_parameters(density_importance=1.0),
    "uniform": with_parameters(density_exponent=0.0),
    "discs": with_parameters(lloyd_iterations=3, falloff_footprint=1.0),
    "more iterations": with_parameters(lloyd_iterations=6, falloff_footprint=1.0),
    "near field": with_parameters(screen_space_strength=1.0),
    "wider near field": with_parameters(screen_space_strength=2.0, screen_space_radius=8.0),
    "transmittance": PLAIN.seen_by("transmittance"),
    "extinction": replace(with_parameters(extinction_coefficient=2.0), visibility="transmittance"),
    "interleaved": with_quality(interleave=4),
    "interleaved by 2": with_quality(interleave=2),
    "other map size": with_quality(map_size=12),
    "not refined": with_quality(map_refinement=1),
    "finer RSM": with_quality(rsm_resolution=128),
    "prior": replace(PLAIN, auto=made_prior()),
    "other prior": replace(PLAIN, auto=made_prior(seed=1)),
}


@pytest.fixture(scope="module")
def runtime(gl_context) -> Runtime:
    return Runtime(colored_room(), RuntimeOptions(light_path="tiles"), context=gl_context)


@pytest.fixture(scope="module")
def alone(gl_context) -> dict[str, np.ndarray]:
    """Every config's radiance, each by a runtime that has never drawn anything else."""
    return {
        name: Runtime(colored_room(), context=gl_context).render_radiance(VIEW, config)
        for name, config in CONFIGS.items()
    }


def test_the_configs_do_differ(alone):
    """Else all of what follows would say nothing."""
    images = list(alone.values())
    for index, image in enumerate(images):
        assert image.any()
        for other in images[:index]:
            assert not np.array_equal(image, other)


@pytest.mark.parametrize("between", [name for name in CONFIGS if name != "plain"])
def test_another_config_between_two_drawings_leaves_no_trace(runtime, alone, between):
    """A, B, A and B, A, B: each is the image of a runtime that drew it alone."""
    for name in ("plain", between, "plain", between):
        np.testing.assert_array_equal(runtime.render_radiance(VIEW, CONFIGS[name]), alone[name], err_msg=name)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_any_order_gives_the_same_images(runtime, alone, seed):
    for name in np.random.default_rng(seed).permutation(list(CONFIGS) * 2):
        np.testing.assert_array_equal(runtime.render_radiance(VIEW, CONFIGS[name]), alone[name], err_msg=name)


def test_every_buffer_is_the_same_again(runtime):
    """Not the image alone: whatever a captured frame holds, but for the order of blocks in a map."""
    config = CONFIGS["interleaved"]
    first = runtime.capture(VIEW, config)
    for name in ("near field", "discs", "extinction", "prior"):
        runtime.capture(VIEW, CONFIGS[name])
    again = runtime.capture(VIEW, config)
    for name in (
        *("valid", "depth", "normal_world", "albedo", "direct_irradiance", "vpl_irradiance"),
        *("indirect_irradiance", "vpl_position_world", "vpl_normal_world", "vpl_footprint", "vpl_flux"),
    ):
        np.testing.assert_array_equal(getattr(again, name), getattr(first, name), err_msg=name)
    for name in ("texels", "block", "details"):
        np.testing.assert_array_equal(
            getattr(again.visibility_maps, name), getattr(first.visibility_maps, name), err_msg=name
        )
    assert again.scene_length == first.scene_length


def test_views_leave_no_trace(runtime):
    """Other sizes, cameras, kinds and numbers of lights."""
    views = [room_view(light, size) for light in ("spot", "point", None) for size in (SIZE, (17, 23))]
    first = [runtime.render_radiance(view, PLAIN) for view in views]
    for view, image in reversed(list(zip(views, first, strict=True))):
        np.testing.assert_array_equal(runtime.render_radiance(view, PLAIN), image, err_msg=view.name)
    assert not first[-1].any()


def test_dynamic_lights_leave_no_trace(runtime):
    without = runtime.render_radiance(VIEW, PLAIN)
    lit = runtime.render_radiance(VIEW, PLAIN, lights=LIGHTS)
    assert (lit - without).max() > 0.01
    np.testing.assert_array_equal(runtime.render_radiance(VIEW, PLAIN), without)
    np.testing.assert_array_equal(runtime.render_radiance(VIEW, PLAIN, lights=LIGHTS), lit)
    none = DynamicLights(
        LIGHTS.numbers.view(point_lights(np.zeros((1, 3)), np.ones(3), 1.0).dtype).ravel()[:0]
    )
    np.testing.assert_array_equal(runtime.render_radiance(VIEW, PLAIN, lights=none), without)


def test_layers_and_exposures_leave_no_trace(runtime):
    config = CONFIGS["near field"]
    first = {layer: runtime.render(VIEW, config, layer=layer) for layer in LAYERS}
    runtime.render(VIEW, config, exposure=100.0)
    runtime.display(np.full((SIZE[1], SIZE[0], 3), 7.0, np.float32), 0.01)
    for layer in reversed(LAYERS):
        np.testing.assert_array_equal(runtime.render(VIEW, config, layer=layer), first[layer], err_msg=layer)


def test_captures_and_variants_leave_no_trace(runtime, alone):
    """They draw some of a frame again, and the next frame starts from its beginning."""
    runtime.captures(VIEW, PLAIN, [(0.0, 0.0), (0.3, 0.7)])
    np.testing.assert_array_equal(runtime.render_radiance(VIEW, PLAIN), alone["plain"])
    runtime.capture_variants(VIEW, [PLAIN, CONFIGS["near field"], CONFIGS["brighter"]], (0.1, 0.2))
    np.testing.assert_array_equal(runtime.render_radiance(VIEW, PLAIN), alone["plain"])
    runtime.capture(VIEW, PLAIN, table_rotation=(0.5, 0.5))
    np.testing.assert_array_equal(runtime.render_radiance(VIEW, PLAIN), alone["plain"])


def test_measurements_leave_no_trace(runtime, alone):
    runtime.pass_milliseconds(VIEW, CONFIGS["discs"], frames=1, lights=LIGHTS)
    runtime.frame_milliseconds(VIEW, CONFIGS["interleaved"], frames=1)
    runtime.draw(VIEW, PLAIN).read_statistics()
    np.testing.assert_array_equal(runtime.render_radiance(VIEW, PLAIN), alone["plain"])


def test_ways_to_draw_agree(runtime, alone):
    """The display image, the radiance and the buffers of one config are of one image."""
    drawn = runtime.draw(VIEW, PLAIN)
    exposure = drawn.read_exposure()
    shown = np.frombuffer(drawn.display.read(), np.uint8).reshape(SIZE[1], SIZE[0], 4)[::-1, :, :3]
    np.testing.assert_array_equal(runtime.render(VIEW, PLAIN), shown)
    np.testing.assert_array_equal(runtime.display(alone["plain"], exposure), shown)
    np.testing.assert_array_equal(runtime.render(VIEW, PLAIN, exposure=exposure), shown)
    captured = runtime.capture(VIEW, PLAIN)
    np.testing.assert_array_equal(
        runtime.render(VIEW, PLAIN, layer="irradiance"), captured.indirect_irradiance
    )
    np.testing.assert_array_equal(runtime.draw(VIEW, PLAIN).capture().vpl_flux, captured.vpl_flux)
    assert runtime.draw(VIEW, PLAIN, exposure=3.0).read_exposure() == 3.0


def test_a_pose_is_taken_back(gl_context):
    runtime = Runtime(colored_room(), context=gl_context)
    at_rest = np.array([instance.to_world for instance in colored_room().instances])
    first = runtime.render_radiance(VIEW, PLAIN)
    moved = at_rest.copy()
    moved[-1, 1, 3] += 0.4
    runtime.pose(Pose(moved, np.zeros((0, 4, 4)), (), ()))
    assert np.abs(runtime.render_radiance(VIEW, PLAIN) - first).max() > 0.01
    runtime.pose(Pose(at_rest, np.zeros((0, 4, 4)), (), ()))
    np.testing.assert_array_equal(runtime.render_radiance(VIEW, PLAIN), first)


def test_two_runtimes_of_one_context_take_turns(gl_context, runtime, alone):
    """They share compiled programs, and nothing else."""
    other = Runtime(colored_room(), RuntimeOptions(rsm_filtering=1, light_path="volumes"), context=gl_context)
    first = other.render_radiance(VIEW, CONFIGS["discs"], lights=LIGHTS)
    for _ in range(2):
        np.testing.assert_array_equal(runtime.render_radiance(VIEW, PLAIN), alone["plain"])
        np.testing.assert_array_equal(other.render_radiance(VIEW, CONFIGS["discs"], lights=LIGHTS), first)


def test_what_a_config_says_beside_its_settings_makes_no_frame(gl_context):
    """Neither do parameters that VPLs and maps can follow without other buffers."""
    runtime = Runtime(colored_room(), context=gl_context)
    runtime.draw(VIEW, PLAIN)
    frame = runtime.draw(VIEW, PLAIN).frame
    for config in (
        replace(PLAIN, provenance={"seed": 1}, fit=FitNote("kept")),
        CONFIGS["brighter"],
        CONFIGS["by importance"],
        CONFIGS["discs"],
        CONFIGS["near field"],
    ):
        assert runtime.draw(VIEW, config).frame is frame
    assert runtime.draw(VIEW, CONFIGS["more VPLs"]).frame is not frame


def test_few_frames_are_kept(gl_context):
    """The two that were used last; a third drops the older one, and its objects with it."""
    assert KEPT_FRAMES == 2
    runtime = Runtime(colored_room(), context=gl_context)
    configs = [with_quality(interleave=side) for side in (1, 2, 4, 8)]
    setups = [FrameSetup.of(VIEW, config, nested_faces=0, glows=False) for config in configs]
    for config in configs * 2:
        runtime.draw(VIEW, config)
        assert len(runtime._frames) <= KEPT_FRAMES
    assert list(runtime._frames) == setups[2:]
    first, second = (runtime.draw(VIEW, config).frame for config in configs[:2])
    assert runtime.draw(VIEW, configs[0]).frame is first
    kept, dropped = weakref.ref(first), weakref.ref(second)
    del first, second
    runtime.draw(VIEW, configs[2])
    assert kept() is not None
    assert dropped() is None, "the frame that was used longest ago goes, without a garbage collection"


@pytest.mark.slow
def test_dropped_frames_give_their_memory_back(gl_context):
    """OpenGL objects that live after many set-ups are as many as after two."""
    runtime = Runtime(colored_room(), context=gl_context)

    def living() -> int:
        gc.collect()
        free_dropped(gl_context)
        kinds = (moderngl.Buffer, moderngl.Texture, moderngl.Framebuffer)
        return sum(isinstance(each, kinds) for each in gc.get_objects())

    counts = []
    for width in range(16, 28):
        runtime.render(room_view("spot", (width, 12)), CONFIGS["prior"])
        counts.append(living())
    assert counts[0] < counts[1] == counts[2]
    assert set(counts[1:]) == {counts[1]}


def test_parameters_are_written_when_they_change_and_not_before(gl_context, monkeypatch):
    written = []
    original = moderngl.Buffer.write

    def write(self, data, *arguments, **keywords):
        if memoryview(data).nbytes == BLOCK_BYTES:
            written.append(bytes(data))
        return original(self, data, *arguments, **keywords)

    runtime = Runtime(colored_room(), context=gl_context)
    runtime.draw(VIEW, PLAIN)
    monkeypatch.setattr(moderngl.Buffer, "write", write)
    for _ in range(3):
        runtime.draw(VIEW, replace(PLAIN, parameters=replace(PLAIN.parameters)))
    assert written == []
    runtime.draw(VIEW, CONFIGS["brighter"])
    runtime.draw(VIEW, CONFIGS["brighter"])
    assert len(written) == 1
    runtime.draw(VIEW, PLAIN)
    assert len(written) == 2


def test_the_gpu_reads_the_parameters_that_were_given(runtime):
    """All of them, from the one buffer, to float32."""
    parameters = ArtistParameters(
        0.75, 1.25, 0.5, 0.0625, 0.125, vpl_count=65, density_exponent=0.25, screen_space_radius=4.0
    )
    drawn = runtime.draw(VIEW, replace(PLAIN, parameters=parameters))
    assert drawn.frame.read_parameters() == parameters == drawn.read_parameters()


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("the framebuffer is not complete (INCOMPLETE_ATTACHMENT)", MachineError),
        ("GLSL Compiler failed", moderngl.Error),
    ],
)
def test_targets_that_memory_cannot_hold_are_said(gl_context, monkeypatch, said, expected):
    """A frame of 16,384² pixels on a small machine; other errors of OpenGL stay defects."""

    def fail(*_, **__):
        raise moderngl.Error(said)

    runtime = Runtime(colored_room(), context=gl_context)
    monkeypatch.setattr("vpltune.renderer.frame.frame.create_gbuffer", fail)
    with pytest.raises(expected, match=said[:20]):
        runtime.render(room_view("spot"), PLAIN)
