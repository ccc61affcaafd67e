"""A view as it was captured knows what it was drawn with, and its image stands for no other config's."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import colored_room, room_view
from made_priors import made_prior
from own_reference import own_reference

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.tuner.surrogate.captured_view import CapturedView, capture_views, runtime_irradiance

CONFIG = TunedConfig(ArtistParameters(vpl_count=64), quality=Quality(rsm_resolution=128), light=ONE_BOUNCE)


@pytest.fixture(scope="module")
def runtime(gl_context) -> Runtime:
    return Runtime(colored_room(), context=gl_context)


def captured_with(runtime: Runtime, config: TunedConfig) -> CapturedView:
    view = room_view()
    reference = own_reference(runtime.capture(view, CONFIG))
    (captured,) = capture_views(runtime, config, (view,), (reference,))
    return captured


def test_an_image_that_was_drawn_with_the_config_is_not_drawn_again(runtime):
    """By whatever view of the same name and place; provenance does not count."""
    captured = captured_with(runtime, CONFIG)
    assert captured.drawn_with == CONFIG
    sourced = replace(CONFIG, provenance={"scene": "room"})
    bare = CapturedView(captured.view, captured.reference, captured.captured)
    for found in (
        runtime_irradiance(runtime, sourced, captured),
        runtime_irradiance(runtime, CONFIG, bare, (captured,)),
    ):
        assert found is captured.captured.indirect_irradiance


@pytest.mark.parametrize(
    "other",
    [
        replace(CONFIG, parameters=ArtistParameters(vpl_count=64, intensity=2.0)),
        replace(CONFIG, visibility="transmittance"),
        replace(CONFIG, quality=Quality(interleave=4, rsm_resolution=128)),
        replace(CONFIG, quality=Quality(map_size=8, rsm_resolution=128)),
        replace(CONFIG, quality=Quality(map_refinement=1, rsm_resolution=128)),
        replace(CONFIG, quality=Quality(rsm_resolution=256)),
    ],
)
def test_whatever_else_a_config_says_is_drawn(runtime, other):
    captured = captured_with(runtime, CONFIG)
    found = runtime_irradiance(runtime, other, captured, (captured,))
    np.testing.assert_array_equal(found, runtime.render(captured.view, other, layer="irradiance"))
    assert (found != captured.captured.indirect_irradiance).any()


def test_of_a_prior_the_parameters_are_known_that_it_set(runtime):
    """Drawn with them and without the prior, the image is the same, to the rounding of its parameters."""
    config = replace(CONFIG, auto=made_prior(strength=0.05))
    captured = captured_with(runtime, config)
    drawn_with = captured.drawn_with
    assert drawn_with.auto is None
    assert drawn_with.quality == CONFIG.quality
    assert drawn_with.parameters != CONFIG.parameters
    image = runtime.render(captured.view, drawn_with, layer="irradiance")
    np.testing.assert_allclose(image, captured.captured.indirect_irradiance, rtol=1e-4, atol=1e-6)
