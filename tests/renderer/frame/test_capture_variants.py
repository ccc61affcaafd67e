"""One placement of the VPLs gathered with several parameters: bitwise what a draw for each of them gives."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import colored_room, room_view

from vpltune.renderer.config.artist_parameters import ArtistParameters, placement
from vpltune.renderer.frame.runtime import Runtime

START = ArtistParameters(vpl_count=64)
DISCS = replace(START, lloyd_iterations=2, density_importance=0.5, falloff_footprint=1.0)
OTHERS = (
    replace(START, intensity=2.0, falloff_footprint=1.5),
    replace(START, extinction_coefficient=0.4, visibility_bias=0.02, visibility_softness=0.2),
    replace(START, screen_space_strength=1.0),
)


@pytest.fixture(scope="module")
def runtime(gl_context):
    return Runtime(colored_room(), "default", rsm_resolution=128, context=gl_context)


@pytest.mark.parametrize("rotation", [(0.0, 0.0), (0.3, 0.7)])
def test_images_are_those_of_single_draws(runtime, rotation):
    view = room_view("spot", size=(24, 18))
    captured, images = runtime.capture_variants(view, [START, *OTHERS], rotation)
    assert captured.visibility_maps is None
    assert np.array_equal(images[0], captured.indirect_irradiance)
    for parameters, image in zip((START, *OTHERS), images, strict=True):
        runtime.parameters = parameters
        assert np.array_equal(image, runtime.capture(view, rotation).indirect_irradiance)
    assert not np.array_equal(images[0], images[1])


def test_discs_placed_by_importance_are_gathered_again_as_they_were(runtime):
    view = room_view("spot", size=(24, 18))
    wide = replace(DISCS, falloff_footprint=1.7, visibility_softness=0.1)
    _, images = runtime.capture_variants(view, [DISCS, wide])
    for parameters, image in zip((DISCS, wide), images, strict=True):
        runtime.parameters = parameters
        assert np.array_equal(image, runtime.capture(view).indirect_irradiance)


def test_parameters_that_place_vpls_differently_are_refused(runtime):
    view = room_view("spot", size=(24, 18))
    for parameters in (
        [],
        [START, replace(START, density_importance=0.5)],
        [START, replace(START, vpl_count=65)],
    ):
        with pytest.raises(ValueError, match="one placement of the VPLs"):
            runtime.capture_variants(view, parameters)


def test_a_placement_is_what_vpls_depend_on():
    assert placement(START) == placement(OTHERS[0]) == (64, 1.0, 0.0, 0)
    assert placement(replace(START, lloyd_iterations=2)) != placement(START)
