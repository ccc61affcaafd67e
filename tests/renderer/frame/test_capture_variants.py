"""One placement of the VPLs gathered with several configs: bitwise what a draw for each of them gives."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import colored_room, room_view
from made_priors import made_prior
from point_vpls import point_vpls

from vpltune.renderer.config.artist_parameters import ArtistParameters, placement
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime

START = point_vpls(vpl_count=64)
DISCS = replace(START, lloyd_iterations=2, density_importance=0.5, falloff_footprint=1.0)
OTHERS = (
    replace(START, intensity=2.0, falloff_footprint=1.5),
    replace(START, extinction_coefficient=0.4, visibility_bias=0.02, visibility_softness=0.2),
    replace(START, screen_space_strength=1.0),
)
QUALITY = Quality(rsm_resolution=128)
VIEW = room_view("spot", size=(24, 18))


def config_of(parameters: ArtistParameters, **quality) -> TunedConfig:
    return TunedConfig(parameters, quality=replace(QUALITY, **quality), light=ONE_BOUNCE)


@pytest.fixture(scope="module")
def runtime(gl_context):
    return Runtime(colored_room(), context=gl_context)


@pytest.mark.parametrize("rotation", [(0.0, 0.0), (0.3, 0.7)])
def test_images_are_those_of_single_draws(runtime, rotation):
    configs = [config_of(parameters) for parameters in (START, *OTHERS)]
    captured, images = runtime.capture_variants(VIEW, configs, rotation)
    assert captured.visibility_maps is None
    assert np.array_equal(images[0], captured.indirect_irradiance)
    for config, image in zip(configs, images, strict=True):
        alone = runtime.capture(VIEW, config, table_rotation=rotation)
        assert np.array_equal(image, alone.indirect_irradiance)
    assert not np.array_equal(images[0], images[1])


def test_images_that_are_interleaved_are_those_of_single_draws(runtime):
    """The list of pixels that need a full gather starts empty each time."""
    configs = [config_of(parameters, interleave=4) for parameters in (START, *OTHERS)]
    _, images = runtime.capture_variants(VIEW, configs)
    for config, image in zip(configs, images, strict=True):
        assert np.array_equal(image, runtime.capture(VIEW, config).indirect_irradiance)


def test_discs_placed_by_importance_are_gathered_again_as_they_were(runtime):
    wide = replace(DISCS, falloff_footprint=1.7, visibility_softness=0.1)
    configs = [config_of(DISCS), config_of(wide)]
    _, images = runtime.capture_variants(VIEW, configs)
    for config, image in zip(configs, images, strict=True):
        assert np.array_equal(image, runtime.capture(VIEW, config).indirect_irradiance)


@pytest.mark.parametrize("parameters", [START, replace(START, screen_space_strength=1.0), DISCS])
def test_rotations_are_those_of_single_draws(runtime, parameters):
    rotations = [(0.0, 0.0), (0.3, 0.7), (0.0, 0.0)]
    config = config_of(parameters, interleave=2)
    frames = runtime.captures(VIEW, config, rotations)
    for rotation, frame in zip(rotations, frames, strict=True):
        alone = runtime.capture(VIEW, config, table_rotation=rotation)
        assert np.array_equal(frame.vpl_position_world, alone.vpl_position_world)
        assert np.array_equal(frame.indirect_irradiance, alone.indirect_irradiance)
    assert np.array_equal(frames[0].indirect_irradiance, frames[2].indirect_irradiance)
    assert not np.array_equal(frames[0].indirect_irradiance, frames[1].indirect_irradiance)
    assert runtime.captures(VIEW, config, []) == []


def test_configs_that_draw_vpls_differently_are_refused(runtime):
    start = config_of(START)
    for configs in (
        [],
        [start, config_of(replace(START, density_importance=0.5))],
        [start, config_of(replace(START, vpl_count=65))],
        [start, config_of(START, rsm_resolution=64)],
        [start, config_of(START, map_size=8)],
        [start, config_of(START, interleave=2)],
        [start, replace(start, visibility="transmittance")],
    ):
        with pytest.raises(ValueError, match="one placement of the VPLs"):
            runtime.capture_variants(VIEW, configs)


def test_a_prior_is_refused(runtime):
    """It would set the parameters that the configs ask for."""
    prior = replace(config_of(START), auto=made_prior())
    with pytest.raises(ValueError, match="must have no prior"):
        runtime.capture_variants(VIEW, [prior, prior])


def test_a_placement_is_what_vpls_depend_on():
    assert placement(START) == placement(OTHERS[0]) == (64, 1.0, 0.0, 0)
    assert placement(replace(START, lloyd_iterations=2)) != placement(START)
