"""VPLs with the light of the RSM texels around theirs: the same energy, on the surface, and steadier."""

import dataclasses

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, quad, room_view, scene_of
from point_vpls import point_vpls

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.scene import Camera, Light, Material, Texture
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View


def runtime_with(scene, gl_context, filtering) -> Runtime:
    return Runtime(scene, RuntimeOptions(rsm_filtering=filtering), context=gl_context)


def config_with(**parameters) -> TunedConfig:
    """Without visibility maps: VPLs are looked at, and light that nothing stands in the way of."""
    quality = Quality(rsm_resolution=256)
    return TunedConfig(
        point_vpls(**parameters), visibility="transmittance", quality=quality, light=ONE_BOUNCE
    )


@pytest.mark.parametrize("light", ROOM_LIGHTS)
@pytest.mark.parametrize("density_exponent", [0.0, pytest.param(0.5, marks=pytest.mark.slow), 1.0])
def test_filtering_keeps_energy(gl_context, light, density_exponent):
    """Total VPL flux is the RSM's, however many texels a VPL looks at; with γ = 1 it is so for each VPL.

    Else tolerance 1 %: the estimate of 4,096 VPLs, whose flux then varies.
    """
    for filtering in (1, 5, 9):
        config = config_with(vpl_count=4096, density_exponent=density_exponent)
        runtime = runtime_with(colored_room(), gl_context, filtering)
        captured = runtime.capture(room_view(light, (8, 8)), config)
        if filtering == 1:
            expected = captured
        np.testing.assert_allclose(captured.vpl_flux.mean(), expected.vpl_flux.mean(), rtol=1e-2)
        np.testing.assert_allclose(captured.scene_length, expected.scene_length, rtol=1e-4)
        if density_exponent == 0.0:  # else area over chance runs away at a cone's rim
            area, expected_area = (np.sum(c.vpl_footprint**2, dtype=np.float64) for c in (captured, expected))
            np.testing.assert_allclose(area, expected_area, rtol=3e-2)


@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_vpls_stand_on_surfaces(gl_context, light):
    """Every VPL lies on a plane of the room, to 1e-5 of its size, with that plane's normal."""
    runtime = runtime_with(colored_room(), gl_context, 5)
    captured = runtime.capture(room_view(light, (8, 8)), config_with(vpl_count=2048))
    lit = captured.vpl_flux.sum(axis=1) > 0.0
    position, normal = captured.vpl_position_world[lit], captured.vpl_normal_world[lit]
    on_wall = np.abs(np.abs(position) - 1.0).min(axis=1) < 2e-5
    board = colored_room().meshes[-1]
    on_board = np.abs((position - board.positions[0]) @ board.normals[0]) < 2e-5
    assert (on_wall | on_board).all()
    along = np.abs(np.sum(position * normal, axis=1))
    np.testing.assert_allclose(along[on_wall & ~on_board], 1.0, atol=1e-4)


def speckled_floor():
    """A floor of 1,024² random texels under a wall: what one RSM texel sees of it is all chance."""
    random = np.random.default_rng(8)
    texture = Texture("speckle", random.integers(0, 256, (1024, 1024, 3)).astype(np.uint8))
    floor = dataclasses.replace(
        quad((-1, 0, -1), (0, 0, 2), (2, 0, 0)), uv=np.array([[0, 0], [0, 1], [1, 1], [1, 0]], np.float32)
    )
    scene = scene_of([floor, quad((-1, 0, -1), (2, 0, 0), (0, 2, 0), 1)], [(1, 1, 1), (0.7, 0.7, 0.7)])
    speckled = Material("speckled", np.ones(3, np.float32), 0)
    return dataclasses.replace(scene, textures=(texture,), materials=(speckled, scene.materials[1]))


def test_filtering_steadies_a_swept_light(gl_context):
    """Under a light that creeps, irradiance from a speckled floor changes less than half as much.

    Uniform density, so that each VPL has the flux of what it sees; the wall alone is looked at.
    """
    camera = Camera(look_at(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, -1.0])), 0.6)
    config = config_with(vpl_count=64, density_exponent=0.0)
    changes = {}
    for filtering in (1, 9):
        runtime = runtime_with(speckled_floor(), gl_context, filtering)
        images = []
        for step in range(12):
            light = Light(
                "spot",
                np.full(3, 4.0),
                np.array([0.003 * step, 1.5, 0.2]),
                np.array([0.0, -1.0, 0.0]),
                0.2,
                0.5,
            )
            view = View("sweep", "fitted", (24, 24), camera, (light,))
            images.append(runtime.render(view, config, layer="irradiance"))
        changes[filtering] = np.abs(np.diff(images, axis=0)).mean()
    assert changes[9] < 0.5 * changes[1]
