"""The gather against integrals that can be done by hand."""

import numpy as np
import pytest
from built_scenes import quad, scene_of
from point_vpls import point_vpls

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.capture import CapturedFrame
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import Camera, Light
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View


def captured_view(scene, gl_context, view, parameters=None) -> CapturedFrame:
    """What the runtime draws with these parameters, by default as points."""
    config = TunedConfig(point_vpls() if parameters is None else parameters, light=ONE_BOUNCE)
    return Runtime(scene, context=gl_context).capture(view, config)


def center_mean(image: np.ndarray, half: int) -> np.ndarray:
    height, width = image.shape[:2]
    middle = image[height // 2 - half : height // 2 + half, width // 2 - half : width // 2 + half]
    return middle.reshape(-1, 3).mean(axis=0)


def test_one_vpl_is_a_coaxial_disc(gl_context):
    """One VPL that faces the receiver gives E = Φ/(π(h² + ℓ²)), the form factor of its disc (α = 1).

    A spot lights a patch of ceiling; the floor below is seen by the camera. Tolerance 0.2 %: the receiver
    is a pixel beside the axis.
    """
    height = 2.0
    ceiling = quad((-0.2, height, -0.2), (0.4, 0, 0), (0, 0, 0.4), 0, "ceiling")
    floor = quad((-3, 0, -3), (0, 0, 6), (6, 0, 0), 0, "floor")
    light = Light("spot", np.full(3, 10.0), np.array([0.0, 1.0, 0.0]), np.array([0.0, 1.0, 0.0]), 0.1, 0.15)
    camera = Camera(look_at(np.array([0.0, 1.5, 0.001]), np.zeros(3)), 0.02)
    scene = scene_of([ceiling, floor], [(0.5, 0.5, 0.5)])
    view = View("disc", "fitted", (8, 8), camera, (light,))
    captured = captured_view(scene, gl_context, view, point_vpls(vpl_count=1, falloff_footprint=1.0))
    to_vpl = captured.vpl_position_world[0] - captured.position_world
    distance_squared = (to_vpl**2).sum(axis=-1)
    # Floor and disc are parallel: both cosines are h/d.
    form = height**2 / distance_squared / (distance_squared + captured.vpl_footprint[0] ** 2)
    expected = captured.vpl_flux[0] / np.pi * form[..., None]
    np.testing.assert_allclose(captured.indirect_irradiance, expected, rtol=1e-4)


def test_light_flux_is_all_accounted_for(gl_context):
    """VPL flux sums to albedo times the light's own flux: 4πI for a point light in a closed box.

    Tolerance 0.1 %: the solid angles of 6 × 512² texels are taken at their centres, which is exact to
    1e-5, and half floats hold the albedo to 5e-4.
    """
    sides = [
        quad((-1, -1, -1), (2, 0, 0), (0, 2, 0)), quad((-1, -1, 1), (2, 0, 0), (0, 2, 0)),
        quad((-1, -1, -1), (0, 2, 0), (0, 0, 2)), quad((1, -1, -1), (0, 2, 0), (0, 0, 2)),
        quad((-1, -1, -1), (2, 0, 0), (0, 0, 2)), quad((-1, 1, -1), (2, 0, 0), (0, 0, 2)),
    ]  # fmt: skip
    light = Light("point", np.array([3.0, 2.0, 1.0]), np.array([0.2, -0.1, 0.3]))
    camera = Camera(look_at(np.array([0.0, 0.0, 0.9]), np.zeros(3)), 1.0)
    view = View("box", "fitted", (8, 8), camera, (light,))
    captured = captured_view(scene_of(sides, [(0.5, 0.5, 0.5)]), gl_context, view)
    np.testing.assert_allclose(captured.vpl_flux.sum(axis=0), 0.5 * 4.0 * np.pi * light.intensity, rtol=1e-3)


def test_sun_flux_is_irradiance_times_area(gl_context):
    """A directional light gives a floor E⊥ · A · cosθ · ρ at any angle: the cosine cancels by texel.

    Tolerance 0.5 %: the floor's edge falls between texels.
    """
    for tilt in (0.0, 0.7, 1.2):
        direction = np.array([np.sin(tilt), -np.cos(tilt), 0.0])
        light = Light("directional", np.full(3, 2.0), direction_world=direction)
        camera = Camera(look_at(np.array([0.0, 3.0, 0.0]), np.zeros(3)), 1.0)
        scene = scene_of([quad((-1, 0, -1), (0, 0, 2), (2, 0, 0))], [(0.5, 0.5, 0.5)])
        captured = captured_view(scene, gl_context, View("sun", "fitted", (8, 8), camera, (light,)))
        np.testing.assert_allclose(captured.vpl_flux.sum(axis=0), 2.0 * 4.0 * np.cos(tilt) * 0.5, rtol=5e-3)


def corner_form_factor(distance: float, width: float, length: float) -> float:
    """From a point on a floor, `distance` from a wall of height `width` and half length `length`.

    The differential element to a perpendicular rectangle with a corner below its normal (Howell, Siegel and
    Mengüç 2010, configuration B-3), twice, for the wall's two halves.
    """
    a = np.sqrt(distance**2 + width**2)
    return 2.0 * (np.arctan(length / distance) - distance / a * np.arctan(length / a)) / (2.0 * np.pi)


@pytest.mark.parametrize("distance", [0.3, 0.6, 1.0])
def test_floor_beside_an_evenly_lit_wall(gl_context, distance):
    """Floor-and-wall corner: a wall lit evenly by the sun gives the floor E = B · F with F in closed form.

    4,096 VPLs on a 2 × 1 wall have footprints of about 0.012, so that α matters little even at 0.3.
    Tolerance 1 %: the wall's edges fall between RSM texels, and VPLs are points.
    """
    wall = quad((-1, 0, 0), (2, 0, 0), (0, 1, 0), 0, "wall")
    floor = quad((-2, 0, 0), (0, 0, 2), (4, 0, 0), 1, "floor")
    # Along −Z: it meets the wall squarely and only grazes the floor, edge on.
    light = Light("directional", np.full(3, 4.0), direction_world=np.array([0.0, 0.0, -1.0]))
    target = np.array([0.0, 0.0, distance])
    camera = Camera(look_at(target + np.array([0.0, 0.8, 0.0]), target), 0.01)
    scene = scene_of([wall, floor], [(0.8, 0.8, 0.8), (0.5, 0.5, 0.5)])
    view = View("corner", "fitted", (8, 8), camera, (light,))
    captured = captured_view(scene, gl_context, view, point_vpls(vpl_count=4096))
    radiosity = 0.8 * 4.0
    expected = radiosity * corner_form_factor(distance, 1.0, 1.0)
    np.testing.assert_allclose(center_mean(captured.indirect_irradiance, 4), expected, rtol=1e-2)


@pytest.mark.parametrize(
    "parameters",
    [point_vpls(vpl_count=8192), ArtistParameters(vpl_count=1024, lloyd_iterations=4), ArtistParameters()],
    ids=["points", "cells", "default"],
)
def test_white_furnace(gl_context, parameters):
    """Inside a closed white box lit evenly, one bounce gives back the irradiance that went in.

    A point light at the centre of a cube cannot light it evenly, but the mean over all walls obeys energy
    conservation: ∫E_indirect dA = Φ_light for albedo 1. The image of one whole wall is taken, and by
    symmetry it stands for all six. Tolerance 2 %: VPLs near the edges lose light to α, or as discs reach past
    them.
    """
    sides = [
        quad((-1, -1, -1), (2, 0, 0), (0, 2, 0)), quad((-1, -1, 1), (2, 0, 0), (0, 2, 0)),
        quad((-1, -1, -1), (0, 2, 0), (0, 0, 2)), quad((1, -1, -1), (0, 2, 0), (0, 0, 2)),
        quad((-1, -1, -1), (2, 0, 0), (0, 0, 2)), quad((-1, 1, -1), (2, 0, 0), (0, 0, 2)),
    ]  # fmt: skip
    light = Light("point", np.full(3, 1.0), np.zeros(3))
    # From the centre a 90° view covers one wall exactly; a pixel's share of it goes with 1/cos⁴.
    camera = Camera(look_at(np.zeros(3), np.array([0.0, 0.0, -1.0])), float(np.pi / 2.0))
    view = View("furnace", "fitted", (64, 64), camera, (light,))
    captured = captured_view(scene_of(sides, [(1.0, 1.0, 1.0)]), gl_context, view, parameters)
    # Pixels of a pinhole image cover equal areas of a plane square to its axis.
    mean = captured.indirect_irradiance.mean(axis=(0, 1))
    np.testing.assert_allclose(mean, 4.0 * np.pi / 24.0, rtol=2e-2)


def test_direct_light_is_inverse_square(gl_context):
    """E = I cosθ / d² at the centre and cos³ away from it, inside a spot's inner cone. Float32: 1e-3."""
    floor = quad((-3, 0, -3), (0, 0, 6), (6, 0, 0))
    light = Light("spot", np.full(3, 5.0), np.array([0.0, 2.0, 0.0]), np.array([0.0, -1.0, 0.0]), 0.6, 0.8)
    camera = Camera(look_at(np.array([0.0, 1.0, 0.0]), np.zeros(3)), 0.8)
    view = View("spot", "fitted", (33, 33), camera, (light,))
    captured = captured_view(scene_of([floor], [(0.5, 0.5, 0.5)]), gl_context, view)
    offset = captured.position_world - light.position_world
    distance = np.linalg.norm(offset, axis=-1)
    expected = 5.0 * (2.0 / distance) / distance**2
    np.testing.assert_allclose(captured.direct_irradiance[..., 0], expected, rtol=1e-3)


def test_empty_scene_view_and_dark_scene(gl_context):
    """No light at all, or light that meets nothing, is a normal case: black, finite, no error."""
    floor = quad((-1, 0, -1), (0, 0, 2), (2, 0, 0))
    away = Light("spot", np.full(3, 5.0), np.array([0.0, 2.0, 0.0]), np.array([0.0, 1.0, 0.0]), 0.1, 0.5)
    camera = Camera(look_at(np.array([0.0, 1.0, 0.0]), np.zeros(3)), 0.8)
    runtime = Runtime(scene_of([floor], [(0.5, 0.5, 0.5)]), context=gl_context)
    for lights in ((), (away,)):
        captured = runtime.capture(
            View("dark", "fitted", (8, 8), camera, lights), TunedConfig(light=ONE_BOUNCE)
        )
        assert captured.valid.all()
        assert not captured.indirect_irradiance.any()
        assert not captured.direct_irradiance.any()
        assert np.isfinite(captured.scene_length)
