"""The runtime's own promises: contexts, layers, exposure."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import colored_room, room_view
from made_priors import made_prior

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.frame.runtime import LAYERS, Runtime

CONFIG = TunedConfig(ArtistParameters(vpl_count=64), quality=Quality(rsm_resolution=128))
"""The default frame with few VPLs: every pass of it runs."""


def test_runtimes_do_not_disturb_each_other():
    """Two runtimes with contexts of their own, used in turn, draw what each drew alone."""
    first = Runtime(colored_room())
    alone = first.render(room_view("spot"), CONFIG, layer="irradiance")
    second = Runtime(colored_room())
    other = second.render(room_view("point"), CONFIG, layer="irradiance")
    np.testing.assert_array_equal(first.render(room_view("spot"), CONFIG, layer="irradiance"), alone)
    np.testing.assert_array_equal(second.render(room_view("point"), CONFIG, layer="irradiance"), other)


def test_a_drawn_frame_is_read_on_its_own_context():
    """Whatever context another runtime has made current since."""
    config = replace(CONFIG, auto=made_prior(), quality=Quality(rsm_resolution=64, map_size=8))
    drawn = Runtime(colored_room()).draw(room_view("spot", (16, 12)), config)

    def found() -> tuple:
        captured = drawn.capture()
        return (
            drawn.read_exposure(),
            drawn.read_parameters(),
            drawn.read_statistics().tolist(),
            captured.indirect_irradiance.tolist(),
            captured.visibility_maps.texels.tolist(),
        )

    before = found()
    other = Runtime(colored_room())
    for reading in (
        lambda: drawn.read_exposure() == before[0],
        lambda: drawn.read_parameters() == before[1],
        lambda: drawn.read_statistics().tolist() == before[2],
        lambda: found() == before,
    ):
        other.draw(room_view("point", (20, 12)), CONFIG)
        assert reading()


def test_a_clip_does_not_change_its_context(gl_context):
    """Its state lies on the GPU, and another context would read something else there."""
    config = replace(CONFIG, auto=made_prior(), quality=Quality(rsm_resolution=64, map_size=8))
    state, view = ClipState(), room_view("spot", (16, 12))
    first = Runtime(colored_room(), context=gl_context)
    first.draw(view, config, state)
    Runtime(colored_room(), context=gl_context).draw(view, config, state)
    with pytest.raises(ValueError, match="a clip is drawn on one OpenGL context"):
        Runtime(colored_room()).draw(view, config, state)
    first.draw(view, config, state)


@pytest.mark.parametrize("layer", LAYERS)
def test_every_layer_has_its_shape_and_values(gl_context, layer):
    image = Runtime(colored_room(), context=gl_context).render(room_view("spot"), CONFIG, layer=layer)
    assert image.shape == ((48, 64) if layer == "depth" else (48, 64, 3))
    assert image.dtype == (np.uint8 if layer == "final" else np.float32)
    assert np.isfinite(image).all()
    assert image.any()


def test_an_object_released_by_hand_does_no_harm(gl_context):
    """moderngl's own collection stops at one; making the next frame must not."""
    gl_context.buffer(reserve=16).release()
    for size in ((16, 12), (20, 12)):
        Runtime(colored_room(), context=gl_context).render(room_view("spot", size), CONFIG, layer="albedo")


def test_direct_and_indirect_add_up(gl_context):
    """Radiance is linear in light: the two layers sum to the whole, to float32's rounding."""
    runtime, view = Runtime(colored_room(), context=gl_context), room_view("spot")
    parts = sum(runtime.render(view, CONFIG, layer=layer) for layer in ("direct", "indirect"))
    np.testing.assert_allclose(parts, runtime.render_radiance(view, CONFIG), rtol=1e-5, atol=1e-7)


def test_white_maps_to_white_and_black_to_black(gl_context):
    """The tone curve's ends; and an even grey keeps equal channels."""
    runtime = Runtime(colored_room(), context=gl_context)
    for level, low, high in ((1e4, 250, 255), (0.0, 0, 0)):
        shown = runtime.display(np.full((4, 4, 3), level, np.float32), 1.0)
        assert shown.min() >= low
        assert shown.max() <= high
    grey = runtime.display(np.full((4, 4, 3), 0.3, np.float32), 1.0)
    assert (grey == grey[..., :1]).all()


def test_measured_exposure_does_not_depend_on_the_light_level(gl_context):
    """An image a thousand times as bright is shown the same, to one step of 8 bits."""
    runtime = Runtime(colored_room(), context=gl_context)
    radiance = runtime.render_radiance(room_view("spot"), CONFIG)
    dim, bright = runtime.display(radiance), runtime.display(radiance * 1000.0)
    assert np.abs(dim.astype(int) - bright.astype(int)).max() <= 1
