"""The screen-space near field: what the softened VPLs withhold, no more and no less."""

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, quad, room_view, scene_of
from point_vpls import point_vpls
from scene_paths import OWN_SCENES

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.capture import CapturedFrame, read_image
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.dynamic_lights import DynamicLights, point_lights
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.scene import Camera, Light, scaled
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View, scaled_view
from vpltune.renderer.techniques.gather_full_rsm import GatherFullRsm
from vpltune.tuner.metrics.view_metrics import energy_ratio
from vpltune.tuner.reference import reference_views

STRONG = {"falloff_footprint": 2.0, "screen_space_strength": 1.0}


def config_with(**parameters) -> TunedConfig:
    # What softening withholds has no occluders to it: neither shall what it is compared with.
    return TunedConfig(
        point_vpls(**parameters),
        visibility="transmittance",
        quality=Quality(rsm_resolution=512),
        light=ONE_BOUNCE,
    )


def captured_corner(gl_context, view=None, **parameters) -> CapturedFrame:
    runtime = Runtime(corner_scene(), context=gl_context)
    return runtime.capture(view or corner_view(), config_with(**parameters))


def corner_scene():
    """A red wall on a white floor, and a spot on the wall's foot."""
    return scene_of(
        [
            quad((-1, 0, 0), (2, 0, 0), (0, 2, 0), 0, "wall"),
            quad((-1, 0, 0), (0, 0, 2), (2, 0, 0), 1, "floor"),
        ],
        [(0.8, 0.2, 0.2), (0.8, 0.8, 0.8)],
        "corner",
    )


def corner_view(size=(160, 120)) -> View:
    light = Light("spot", np.full(3, 6.0), np.array([0.0, 1.2, 1.4]), np.array([0.0, -0.65, -0.76]), 0.2, 0.5)
    camera = Camera(look_at(np.array([0.3, 1.2, 3.0]), np.array([0.0, 0.5, 0.4])), 0.7)
    return View("corner", "fitted", size, camera, (light,))


def mean_footprint(captured) -> float:
    return float(np.sqrt((captured.vpl_footprint**2).mean()))


def test_without_softening_there_is_nothing_to_give_back(gl_context):
    captured = captured_corner(gl_context, falloff_footprint=0.0, screen_space_strength=1.0)
    np.testing.assert_array_equal(captured.indirect_irradiance, captured.vpl_irradiance)
    assert captured.vpl_irradiance.any()


def test_strength_scales_it_and_the_gather_is_untouched(gl_context):
    """Half the strength gives half the near field, to float32; the VPLs' part is bitwise the same."""
    views = [
        captured_corner(gl_context, falloff_footprint=2.0, screen_space_strength=strength)
        for strength in (0.0, 0.5, 1.0)
    ]
    none, half, full = (view.indirect_irradiance - view.vpl_irradiance for view in views)
    assert not none.any()
    assert full.any()
    np.testing.assert_allclose(2.0 * half, full, atol=2e-6 * float(views[2].indirect_irradiance.max()))
    np.testing.assert_array_equal(views[0].vpl_irradiance, views[2].vpl_irradiance)


@pytest.mark.parametrize("density_exponent", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_pixels_know_the_footprints_of_their_vpls(gl_context, light, density_exponent):
    """A pixel's l is that of a VPL drawn at its place, for every kind of light and every γ.

    Compared where a VPL falls into a pixel; the median within 3 %, as the light varies within a pixel and
    radiosity comes through half floats.
    """
    view = room_view(light, (192, 144))
    config = config_with(density_exponent=density_exponent, **STRONG)
    drawn = Runtime(colored_room(), context=gl_context).draw(view, config)
    captured, emitters = drawn.capture(), read_image(drawn.frame.resources, "emitters")
    position = captured.vpl_position_world @ view.camera.world_to_camera[:3, :3].T
    position = position + view.camera.world_to_camera[:3, 3]
    focal = 0.5 * view.size[1] / np.tan(view.camera.yfov / 2.0)
    column = (view.size[0] / 2.0 + focal * position[:, 0] / -position[:, 2]).astype(int)
    row = (view.size[1] / 2.0 - focal * position[:, 1] / -position[:, 2]).astype(int)
    inside = (column >= 0) & (column < view.size[0]) & (row >= 0) & (row < view.size[1])
    column, row = column[inside], row[inside]
    expected = captured.vpl_footprint[inside]
    apart = np.linalg.norm(captured.position_world[row, column] - captured.vpl_position_world[inside], axis=1)
    met = captured.valid[row, column] & (apart < 1.5 * -position[inside, 2] / focal)
    met &= emitters[row, column, 3] > 0.0
    assert met.sum() > 50
    ratio = np.sqrt(emitters[row, column, 3][met]) / expected[met]
    assert np.median(ratio) == pytest.approx(1.0, rel=0.03)
    assert np.quantile(np.abs(ratio - 1.0), 0.8) < 0.15


def test_it_gives_back_what_softening_took(gl_context):
    """Against a gather from the whole RSM, which is hardly softened, with α = 2 and 64 VPLs.

    Within two footprints of the corner, where the VPLs lose two fifths of the light, the mean is right within
    5 % with the near field, and the absolute error falls by two thirds or more. A footprint is 6 pixels: at
    3 pixels a tenth of the light there is missed, which comes from within one pixel.
    """
    parameters = point_vpls(falloff_footprint=2.0, screen_space_strength=1.0, vpl_count=64)
    config = TunedConfig(parameters, quality=Quality(rsm_resolution=256), light=ONE_BOUNCE)
    drawn = Runtime(corner_scene(), context=gl_context).draw(corner_view(), config)
    captured = drawn.capture()
    gathered = GatherFullRsm(drawn.frame, 2).draw(drawn.inputs)
    truth = read_image(gathered, "vpl_irradiance")[..., :3]
    reach = 2.0 * mean_footprint(captured)
    near = captured.valid & (captured.position_world[..., 1:] < reach).all(axis=2)
    near &= truth.min(axis=2) > 0.1 * truth[near].mean()
    assert near.sum() > 300
    alone, together = captured.vpl_irradiance[near], captured.indirect_irradiance[near]
    assert energy_ratio(alone, truth[near]) < 0.7
    assert energy_ratio(together, truth[near]) == pytest.approx(1.0, abs=0.05)
    assert np.abs(together - truth[near]).mean() < np.abs(alone - truth[near]).mean() / 3.0


@pytest.mark.parametrize("factor", [0.01, 0.1, 10.0, 100.0])
def test_scale_changes_nothing(gl_context, factor):
    """Scene, camera and light scaled together give the same near field, to 1e-3 of the image."""
    near = captured_corner(gl_context, **STRONG).indirect_irradiance
    other = Runtime(scaled(corner_scene(), factor), context=gl_context)
    grown = other.capture(scaled_view(corner_view(), factor), config_with(**STRONG)).indirect_irradiance
    assert np.sqrt(np.mean((grown - near) ** 2) / np.mean(near**2)) < 1e-3


def test_the_number_of_vpls_matters_less(gl_context):
    """From 4,096 VPLs down to 64, the near field keeps most of the energy that wider footprints withhold."""
    means = {}
    for count in (64, 4096):
        captured = captured_corner(gl_context, vpl_count=count, **STRONG)
        means[count] = (captured.vpl_irradiance.mean(), captured.indirect_irradiance.mean())
    alone, together = (abs(means[64][i] / means[4096][i] - 1.0) for i in (0, 1))
    assert alone > 0.1
    assert together < 0.4 * alone


def test_the_image_size_matters_little(gl_context):
    """Four times the pixels: the near field's energy moves by less than 10 %, the image's by under 2 %."""
    means = []
    for size in ((160, 120), (320, 240)):
        captured = captured_corner(gl_context, corner_view(size), vpl_count=64, **STRONG)
        seen = captured.valid
        means.append((captured.vpl_irradiance[seen].mean(), captured.indirect_irradiance[seen].mean()))
    (alone, together), (alone_fine, together_fine) = means
    assert together_fine == pytest.approx(together, rel=0.02)
    assert together_fine - alone_fine == pytest.approx(together - alone, rel=0.1)


def test_dynamic_lights_have_no_near_field(gl_context):
    """They cast no VPLs, so that nothing was withheld: the near field is the same with and without them."""
    runtime = Runtime(corner_scene(), context=gl_context)
    lights = DynamicLights(point_lights(np.array([[0.0, 0.5, 0.5]]), np.full(3, 3.0), 2.0))
    plain, lit = (
        runtime.capture(corner_view(), config_with(**STRONG), lights=each) for each in (None, lights)
    )
    assert lit.direct_irradiance.mean() > 1.2 * plain.direct_irradiance.mean()
    near, beside = (captured.indirect_irradiance - captured.vpl_irradiance for captured in (plain, lit))
    # Half floats hold the dynamic lights to 5e-4 of their own size.
    np.testing.assert_allclose(beside.mean(), near.mean(), rtol=0.02)


def test_frames_repeat_bitwise(gl_context):
    runtime, config = Runtime(corner_scene(), context=gl_context), config_with(**STRONG)
    first = runtime.capture(corner_view(), config).indirect_irradiance
    runtime.capture(corner_view((64, 48)), config)
    np.testing.assert_array_equal(runtime.capture(corner_view(), config).indirect_irradiance, first)


def contact_pixels(reference, reach: float) -> np.ndarray:
    """Valid pixels with a directly lit surface facing them, and they it, within `reach`."""
    from scipy.spatial import cKDTree

    seen = reference.valid
    position, normal = reference.position_world[seen], reference.normal_world[seen]
    lit = reference.direct_irradiance[seen].sum(axis=1) > 0.0
    neighbours = cKDTree(position[lit]).query_ball_point(position, reach)
    near = np.zeros(len(position), bool)
    for index, found in enumerate(neighbours):
        offset = position[lit][found] - position[index]
        distance = np.linalg.norm(offset, axis=1) + 1e-300
        cosine = offset @ normal[index] / distance
        cosine_emitter = -(offset * normal[lit][found]).sum(axis=1) / distance
        near[index] = bool(((cosine > 0.1) & (cosine_emitter > 0.1)).any())
    image = np.zeros(seen.shape, bool)
    image[seen] = near
    return image


@pytest.mark.slow
@pytest.mark.parametrize("path", [p for p in OWN_SCENES if p.stem != "courtyard"], ids=lambda path: path.stem)
def test_contacts_come_nearer_to_the_reference(gl_context, path):
    """Within two footprints of contacts the error falls by 30 %; the mean moves by less than 2 %.

    RMS error against the path tracer, α = 2, 1,024 VPLs, footprints of 3 pixels. The courtyard is left
    out: its sun lights most of what is seen from within a few footprints, so that softening takes a tenth of
    all light there, and giving it back moves the mean by as much.
    """
    scene = read_scene(path)
    camera, lights, _ = resolve_camera_and_lights(scene, path, None, None)
    view = View(path.stem, "fitted", (192, 144), camera, lights)
    (reference,) = reference_views(scene, (view,), noise_target=1e-3, max_samples=1024, bounces=1)
    config = TunedConfig(point_vpls(**STRONG), visibility="transmittance", light=ONE_BOUNCE)
    captured = Runtime(scene, context=gl_context).capture(view, config)
    near = captured.valid & contact_pixels(reference, 2.0 * mean_footprint(captured))
    truth = reference.irradiance[near]
    alone, together = (
        np.sqrt(np.mean((image[near] - truth) ** 2))
        for image in (captured.vpl_irradiance, captured.indirect_irradiance)
    )
    assert together < 0.7 * alone
    seen = captured.valid & reference.valid
    moved = captured.indirect_irradiance[seen].mean() / captured.vpl_irradiance[seen].mean() - 1.0
    assert 0.0 < moved < 0.02
