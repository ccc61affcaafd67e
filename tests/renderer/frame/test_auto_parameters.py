"""Parameters that follow the scene: what the GPU sets is what the prior says, eased over time where asked."""

import dataclasses

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view
from made_priors import made_prior

from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS, place_of
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.passes.auto_parameters import LARGEST_STEP
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.scene import scaled
from vpltune.renderer.scene.views import scaled_view

BASE = ArtistParameters(vpl_count=64, screen_space_radius=5.0)
CONFIG = TunedConfig(BASE, visibility="maps", auto=made_prior())


def runtime_of(context, adaptation_frames=0.0, config=CONFIG, factor=1.0) -> Runtime:
    options = RuntimeOptions(adaptation_frames=adaptation_frames)
    return Runtime(scaled(colored_room(), factor), config, options, context=context, rsm_resolution=128)


def places(parameters: ArtistParameters) -> np.ndarray:
    values = parameters.as_dict()
    return np.array([place_of(parameter_spec(name), values[name]) for name in AUTO_PARAMETERS])


def drawn_places(runtime: Runtime, view) -> np.ndarray:
    runtime.draw(view)
    return places(runtime.drawn_parameters())


@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_the_gpu_evaluates_the_prior(gl_context, light):
    """To 1e-5 of an axis: tanh and pow of a driver are good to some 1e-6."""
    runtime = runtime_of(gl_context)
    found = drawn_places(runtime, room_view(light))
    statistics = runtime.scene_statistics(room_view(light)).astype(np.float64)
    np.testing.assert_allclose(found, CONFIG.auto.point(statistics), atol=1e-5)
    assert runtime.drawn_parameters().screen_space_radius == 5.0


def test_the_image_is_drawn_with_them(gl_context):
    """The same as with the parameters that were read back, given by hand; to their float32."""
    runtime = runtime_of(gl_context)
    image = runtime.render(room_view(), "irradiance")
    found = runtime.drawn_parameters()
    assert found != BASE
    runtime.parameters = found
    by_hand = runtime.render(room_view(), "irradiance")
    np.testing.assert_allclose(by_hand, image, rtol=1e-4, atol=1e-6)
    assert runtime.drawn_parameters() == found
    runtime.parameters = BASE
    assert np.abs(runtime.render(room_view(), "irradiance") - image).max() > 0.05 * image.max()


def test_scale_changes_nothing(gl_context):
    """Scene and light ×0.01 and ×100: the same parameters, to 1e-3 of an axis."""
    plain = drawn_places(runtime_of(gl_context), room_view())
    for factor in (0.01, 100.0):
        other = drawn_places(runtime_of(gl_context, factor=factor), scaled_view(room_view(), factor))
        np.testing.assert_allclose(other, plain, atol=1e-3)


def test_a_still_takes_what_it_asks_for(gl_context):
    """Whatever was drawn before."""
    runtime = runtime_of(gl_context)
    first = drawn_places(runtime, room_view("spot"))
    assert np.abs(drawn_places(runtime, room_view("wide_spot")) - first).max() > 1e-3
    np.testing.assert_array_equal(drawn_places(runtime, room_view("spot")), first)


def test_an_eased_frame_moves_by_little(gl_context):
    """The first frame is exact; then no step is larger than the bound, each goes the target's way, and the
    target is reached."""
    config = dataclasses.replace(CONFIG, auto=made_prior(strength=0.2))
    runtime = runtime_of(gl_context, 2.0, config)
    exact = runtime_of(gl_context, 0.0, config)
    start, goal = (drawn_places(exact, room_view(light)) for light in ("spot", "wide_spot"))
    assert np.abs(goal - start).max() > 4.0 * LARGEST_STEP
    here = drawn_places(runtime, room_view("spot"))
    np.testing.assert_allclose(here, start, atol=1e-6)
    for _ in range(60):
        there = drawn_places(runtime, room_view("wide_spot"))
        # 2e-6: places are found again from float32 values.
        assert np.abs(there - here).max() <= LARGEST_STEP + 2e-6
        assert ((there - here) * (goal - here) >= -1e-9).all()
        here = there
    np.testing.assert_allclose(here, goal, atol=1e-4)


def test_darkness_has_parameters_too(gl_context):
    runtime = runtime_of(gl_context)
    assert np.isfinite(drawn_places(runtime, room_view(None))).all()
    assert not runtime.render(room_view(None), "irradiance").any()


def test_nothing_was_drawn_yet(gl_context):
    with pytest.raises(ValueError, match="drawn_parameters: no image has been drawn yet"):
        runtime_of(gl_context).drawn_parameters()
    with pytest.raises(ValueError, match="adaptation_frames: must be in"):
        RuntimeOptions(adaptation_frames=-1.0)
