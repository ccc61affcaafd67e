"""Nothing comes back from the GPU while a frame is drawn: every way to read through moderngl is counted."""

from collections import Counter

import moderngl
import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view
from made_priors import made_prior
from point_vpls import point_vpls

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.dynamic_lights import DynamicLights, point_lights
from vpltune.renderer.scene.views import View

READS = {
    moderngl.Buffer: ("read", "read_into", "read_chunks", "read_chunks_into"),
    moderngl.Texture: ("read", "read_into"),
    moderngl.TextureArray: ("read", "read_into"),
    moderngl.TextureCube: ("read", "read_into"),
    moderngl.Texture3D: ("read", "read_into"),
    moderngl.Framebuffer: ("read", "read_into"),
    moderngl.Context: ("finish",),
    moderngl.Query: ("__enter__", "__exit__"),
    moderngl.Uniform: ("read",),
}
"""What returns data, and what waits for the GPU."""

ALLOCATIONS = (
    "buffer",
    "texture",
    "depth_texture",
    "framebuffer",
    "vertex_array",
    "program",
    "compute_shader",
)


@pytest.fixture
def calls(monkeypatch) -> Counter:
    """How often each way to read, to wait and to allocate was called."""
    counted = Counter()

    def count(owner, name):
        original = getattr(owner, name)

        def call(*arguments, **keywords):
            counted[f"{owner.__name__}.{name}"] += 1
            return original(*arguments, **keywords)

        monkeypatch.setattr(owner, name, call)

    for owner, names in READS.items():
        for name in names:
            count(owner, name)
    for name in ALLOCATIONS:
        count(moderngl.Context, name)
    return counted


def moving_lights(seed: int) -> DynamicLights:
    positions = np.random.default_rng(seed).uniform(-1.0, 1.0, (100, 3))
    return DynamicLights(point_lights(positions, np.full(3, 0.05), 0.5))


def everything_view(size=(48, 32)) -> View:
    view = room_view("spot", size)
    return View("all", view.split, size, view.camera, tuple(ROOM_LIGHTS.values()))


def few_vpls(**quality) -> TunedConfig:
    """The default frame, of which nothing that is counted here depends on how many VPLs there are."""
    return TunedConfig(ArtistParameters(vpl_count=64), quality=Quality(rsm_resolution=64, **quality))


@pytest.mark.parametrize(("light_path", "interleave"), [("auto", 4), ("volumes", 1), ("tiles", 1)])
def test_a_frame_reads_nothing_back(gl_context, calls, light_path, interleave):
    """Ten frames with all kinds of lights, after the first: no read, no wait and no allocation at all."""
    runtime = Runtime(colored_room(), RuntimeOptions(light_path=light_path), context=gl_context)
    config = few_vpls(interleave=interleave)
    view = everything_view()
    runtime.draw(view, config, lights=moving_lights(0))
    calls.clear()
    for frame in range(10):
        runtime.draw(view, config, lights=moving_lights(frame))
    assert not calls


@pytest.mark.parametrize("in_a_clip", [True, False])
def test_parameters_that_follow_the_scene_are_not_read_back(gl_context, calls, in_a_clip):
    """With a prior: measured and set on the GPU, frame by frame, eased or not."""
    quality = Quality(rsm_resolution=64, adaptation_frames=5.0)
    config = TunedConfig(ArtistParameters(vpl_count=64), auto=made_prior(), quality=quality)
    runtime = Runtime(colored_room(), context=gl_context)
    state = ClipState() if in_a_clip else None
    runtime.draw(everything_view(), config, state)
    calls.clear()
    for _ in range(5):
        drawn = runtime.draw(everything_view(), config, state)
    assert not calls
    drawn.read_parameters()
    assert calls == {"Buffer.read": 1}


def test_parameters_that_are_given_are_not_read_back_either(gl_context, calls):
    config = TunedConfig(ArtistParameters(vpl_count=64), quality=Quality(rsm_resolution=64))
    drawn = Runtime(colored_room(), context=gl_context).draw(everything_view(), config)
    calls.clear()
    assert drawn.read_parameters() == config.parameters
    assert not calls


@pytest.mark.parametrize(
    "changes",
    [{"lloyd_iterations": 2}, {"density_importance": 0.5}, {"screen_space_strength": 1.0}],
    ids=lambda changes: next(iter(changes)),
)
def test_techniques_that_a_config_asks_for_read_nothing_back(gl_context, calls, changes):
    """VPLs are clustered, placed and completed on the GPU; all buffers are there after one frame."""
    config = TunedConfig(point_vpls(vpl_count=64, **changes), quality=Quality(rsm_resolution=64))
    runtime = Runtime(colored_room(), context=gl_context)
    runtime.draw(everything_view(), config)
    calls.clear()
    for _ in range(5):
        runtime.draw(everything_view(), config)
    assert not calls


def test_two_configs_in_turn_read_and_allocate_nothing(gl_context, calls):
    """The frames of both are kept, and so are the programs for points and discs."""
    quality = Quality(rsm_resolution=64)
    configs = [
        TunedConfig(point_vpls(vpl_count=64), quality=quality),
        TunedConfig(ArtistParameters(vpl_count=32), visibility="transmittance", quality=quality),
    ]
    runtime = Runtime(colored_room(), context=gl_context)
    for config in configs:
        runtime.draw(everything_view(), config)
    calls.clear()
    for config in configs * 3:
        runtime.draw(everything_view(), config)
    assert not calls


def test_the_first_frame_reads_nothing_either(gl_context, calls):
    """Only the choice of a light path waits for the GPU, to time it; no data comes back."""
    runtime = Runtime(colored_room(), context=gl_context)
    config = few_vpls()
    calls.clear()
    runtime.draw(everything_view(), config, lights=moving_lights(0))
    assert {name for name in calls if name.split(".")[1] not in ALLOCATIONS} == {"Context.finish"}


def test_reads_are_seen(gl_context, calls):
    """The count is not blind: an image asked for is one read, buffers captured are more."""
    runtime = Runtime(colored_room(), context=gl_context)
    config = few_vpls()
    view = everything_view()
    runtime.render(view, config)
    assert calls["Texture.read"] == 1
    runtime.capture(view, config)
    assert calls["Texture.read"] > 4
    # VPLs, the frame's statistics, the visibility maps and their finer blocks.
    assert calls["Buffer.read"] == 4
