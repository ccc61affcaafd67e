"""Visibility maps: the shader's lookup against its JAX twin, and properties that true visibility has."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, quad, room_view, scene_of
from point_vpls import point_vpls
from scene_paths import OUTSIDE_SCENES, OWN_SCENES, outside_scene

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.capture import CapturedFrame
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.scene import Camera, Light, scaled
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View, scaled_view
from vpltune.tuner.surrogate.virtual_point_lights import gather_inputs
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather
from vpltune.tuner.surrogate.vpl_visibility import (
    hemi_octahedral_decode,
    hemi_octahedral_encode,
    map_visibility,
)

PARAMETERS = ArtistParameters(vpl_count=256)
FORMS = {"points": point_vpls(vpl_count=256), "discs": PARAMETERS}
MAPS = TunedConfig(PARAMETERS, visibility="maps", quality=Quality(rsm_resolution=256))


def relative_rms(value: np.ndarray, expected: np.ndarray) -> float:
    value, expected = value.astype(np.float64), expected.astype(np.float64)
    return float(np.sqrt(np.mean((value - expected) ** 2) / np.mean(expected**2)))


def surrogate(captured: CapturedFrame, parameters: ArtistParameters) -> np.ndarray:
    receivers, vpls = gather_inputs(captured)
    visibility = map_visibility(captured, receivers, vpls, parameters)
    return np.asarray(jax.jit(gather)(receivers, vpls, FalloffParameters.of(parameters), visibility))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("light", "bias", "softness"),
    [
        pytest.param(light, *pair, marks=() if light == "spot" or pair[0] == 0.0001 else pytest.mark.slow)
        for light in ROOM_LIGHTS
        for pair in ((0.0001, 0.0005), (0.0005, 0.001), (0.1, 0.5))
    ],
)
def test_twins_agree_in_the_room(gl_context, light, bias, softness, form):
    """The relative RMSE is below 1e-3 over all pixels, including those at shadow edges.

    For some ten of 10⁶ pairs, rounding decides between two adjacent texels; each has a 256th of a pixel's
    light.
    """
    parameters = replace(FORMS[form], visibility_bias=bias, visibility_softness=softness)
    runtime = Runtime(colored_room(), context=gl_context)
    captured = runtime.capture(room_view(light, (32, 24)), MAPS.with_parameters(parameters))
    drawn = captured.vpl_irradiance[captured.valid]
    assert drawn.any()
    assert relative_rms(surrogate(captured, parameters), drawn) < 1e-3


def scene_twin_error(path, gl_context) -> float:
    scene = read_scene(path)
    camera, lights, _ = resolve_camera_and_lights(scene, path, None, None)
    view = View(path.stem, "fitted", (32, 24), camera, lights)
    captured = Runtime(scene, context=gl_context).capture(view, MAPS)
    drawn = captured.vpl_irradiance[captured.valid]
    image = surrogate(captured, PARAMETERS)
    return relative_rms(image, drawn) if drawn.any() else float(np.abs(image).max())


@pytest.mark.parametrize("path", OWN_SCENES, ids=lambda path: path.stem)
def test_twins_agree_on_our_scenes(gl_context, path):
    assert scene_twin_error(path, gl_context) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("name", OUTSIDE_SCENES)
def test_twins_agree_on_scenes_of_others(gl_context, scenes_folder, name):
    assert scene_twin_error(outside_scene(scenes_folder, name), gl_context) < 1e-3


def test_hemi_octahedral_map_is_one_to_one():
    """Encoding a decoded point returns it to 1e-6, and every decoded direction is in the upper hemisphere."""
    grid = np.stack(np.meshgrid(np.linspace(-1, 1, 33), np.linspace(-1, 1, 33)), axis=-1).astype(np.float32)
    direction = hemi_octahedral_decode(jnp.asarray(grid))
    assert float(direction[..., 2].min()) >= -1e-6
    np.testing.assert_allclose(hemi_octahedral_encode(direction), grid, atol=1e-6)


def walled_scene(with_wall: bool):
    """A floor with a wall at its left edge, and optionally a second wall across its middle."""
    meshes = [quad((-2, 0, -2), (0, 0, 4), (4, 0, 0), 0, "floor"), quad((-2, 0, -2), (0, 2, 0), (0, 0, 4))]
    if with_wall:
        meshes.append(quad((0, 0, -2), (0, 2, 0), (0, 0, 4), 0, "wall"))
    return scene_of(meshes, [(0.8, 0.8, 0.8)])


def behind_the_wall(gl_context, with_wall: bool, visibility: str) -> np.ndarray:
    """Indirect irradiance on a patch of floor at x = 1, which only the left wall lights."""
    light = Light("spot", np.full(3, 9.0), np.array([-1.0, 1.5, 0.0]), np.array([-0.8, -0.6, 0.0]), 0.3, 0.5)
    target = np.array([1.0, 0.0, 0.0])
    camera = Camera(look_at(target + np.array([0.3, 1.5, 0.0]), target), 0.15)
    config = MAPS.seen_by(visibility)
    view = View("patch", "fitted", (8, 8), camera, (light,))
    captured = Runtime(walled_scene(with_wall), context=gl_context).capture(view, config)
    assert captured.valid.all()
    return captured.vpl_irradiance


def test_a_wall_stops_the_light(gl_context):
    """At most 1 % passes a wall of zero thickness that stands on the floor between VPLs and receivers.

    That light comes from low VPLs: the map's nearest ray to a nearly horizontal direction may hit the floor
    before the wall.
    """
    passing = behind_the_wall(gl_context, True, "transmittance")
    assert passing.min() > 0.0
    assert behind_the_wall(gl_context, True, "maps").max() < 0.01 * passing.max()


def test_nothing_between_leaves_light_as_it_is(gl_context):
    """In an open, convex scene, maps remove no light at all."""
    free, seen = (behind_the_wall(gl_context, False, mode) for mode in ("transmittance", "maps"))
    np.testing.assert_array_equal(seen, free)


@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_scale_changes_nothing(gl_context, factor):
    """With maps, a scaled scene gives the same image to a relative RMSE of 1e-3.

    Because of rounding, a ray that grazes an edge may pass it on the other side, which changes one texel of a
    map.
    """
    image, grown = (
        Runtime(scaled(colored_room(), scale), context=gl_context).render(
            scaled_view(room_view("spot", (32, 24)), scale), MAPS, layer="irradiance"
        )
        for scale in (1.0, factor)
    )
    assert relative_rms(grown, image) < 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_more_vpls_keep_the_mean(gl_context, light):
    """Doubling the VPL count with maps changes the mean irradiance by less than 1 %, as without maps."""
    means = []
    for count in (1024, 2048):
        config = MAPS.with_parameters(ArtistParameters(vpl_count=count))
        captured = Runtime(colored_room(), context=gl_context).capture(room_view(light, (96, 72)), config)
        means.append(captured.vpl_irradiance[captured.valid].mean())
    assert means[1] == pytest.approx(means[0], rel=1e-2)


def test_finer_texels_lie_at_silhouettes_alone(gl_context):
    """A room with a board has refined texels, and so has an open floor at the sky. A closed room has none."""
    inside = Camera(look_at(np.array([0.0, 0.0, 0.9]), np.zeros(3)), 1.2)
    room = colored_room()
    front = quad((-1, -1, 1), (0, 2, 0), (2, 0, 0), 0, "front")
    closed = scene_of([*room.meshes[:-1], front], [tuple(each.base_color) for each in room.materials])
    view = room_view("spot")
    boarded, open_to_the_sky, alone = (
        Runtime(scene, context=gl_context).capture(seen, MAPS).visibility_maps
        for scene, seen in ((room, view), (walled_scene(False), view), (closed, replace(view, camera=inside)))
    )
    for maps in (boarded, open_to_the_sky):
        assert 0.01 < (maps.block >= 0).mean() < 0.2
        assert len(maps.block_distance) == (maps.block >= 0).sum()
    assert not (alone.block >= 0).any()


def test_refined_maps_are_nearly_maps_so_much_finer(gl_context):
    """Maps of 24² texels, refined 2 times, have less than a third of the error of 24² alone, against 48².

    A fifth was measured. The remaining error is due to objects so small that no neighbouring texel hit them.
    """
    runtime = Runtime(colored_room(), context=gl_context)

    def light(size: int, refinement: int) -> np.ndarray:
        config = replace(MAPS, quality=Quality(map_size=size, map_refinement=refinement, rsm_resolution=256))
        return runtime.capture(room_view("spot"), config).vpl_irradiance

    finer = light(48, 1)
    assert relative_rms(light(24, 2), finer) < relative_rms(light(24, 1), finer) / 3.0
