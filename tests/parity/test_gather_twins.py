"""The surrogate's gather against the runtime's, on the same buffers."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view
from corner import corner
from point_vpls import point_vpls
from scene_paths import OUTSIDE_SCENES, OWN_SCENES, outside_scene

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.scene import Camera, Light
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View
from vpltune.tuner.surrogate.receiver_chunks import receivers_at_once
from vpltune.tuner.surrogate.tabulated_gather import gather_tabulated, tabulate_gather
from vpltune.tuner.surrogate.virtual_point_lights import gather_inputs
from vpltune.tuner.surrogate.vpl_gather import (
    PAIRS_AT_ONCE,
    FalloffParameters,
    gather,
    gather_pairwise,
)

POINTS = (
    point_vpls(vpl_count=256),
    point_vpls(vpl_count=256, intensity=0.7, falloff_footprint=2.0, extinction_coefficient=0.8),
    point_vpls(vpl_count=256, intensity=3.0, falloff_footprint=0.1, extinction_coefficient=0.0),
)

# Visibility maps have their own twins in test_visibility_twins.py.
WITHOUT_MAPS = TunedConfig(POINTS[0], visibility="transmittance", quality=Quality(rsm_resolution=256))


def relative_rms(value: np.ndarray, expected: np.ndarray) -> float:
    value, expected = value.astype(np.float64), expected.astype(np.float64)
    return float(np.sqrt(np.mean((value - expected) ** 2) / np.mean(expected**2)))


DISCS = (
    ArtistParameters(vpl_count=256),
    ArtistParameters(vpl_count=32, lloyd_iterations=4, falloff_footprint=1.0),
    ArtistParameters(
        vpl_count=200,
        lloyd_iterations=2,
        intensity=0.7,
        falloff_footprint=0.4,
        extinction_coefficient=0.8,
    ),
    ArtistParameters(vpl_count=200, lloyd_iterations=1, falloff_footprint=2.0),
)


def twin_error(runtime: Runtime, view: View, parameters: ArtistParameters) -> float:
    captured = runtime.capture(view, WITHOUT_MAPS.with_parameters(parameters))
    receivers, vpls = gather_inputs(captured)
    image = np.asarray(jax.jit(gather)(receivers, vpls, FalloffParameters.of(parameters)))
    drawn = captured.indirect_irradiance[captured.valid]
    if not drawn.any():  # for example four plates in one plane: both must be black
        assert not image.any()
        return 0.0
    return relative_rms(image, drawn)


@pytest.mark.parametrize("parameters", (*POINTS, *DISCS))
@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_twins_agree_in_the_room(gl_context, light, parameters):
    """The relative RMSE is below 1e-4: both twins use float32, in different coordinates."""
    runtime = Runtime(colored_room(), context=gl_context)
    assert twin_error(runtime, room_view(light), parameters) < 1e-4


def scene_twin_error(path, gl_context) -> float:
    scene = read_scene(path)
    camera, lights, _ = resolve_camera_and_lights(scene, path, None, None)
    view = View(path.stem, "fitted", (48, 36), camera, lights)
    runtime = Runtime(scene, context=gl_context)
    return max(twin_error(runtime, view, parameters) for parameters in (*POINTS[1:], *DISCS[:2]))


@pytest.mark.parametrize("path", OWN_SCENES, ids=lambda path: path.stem)
def test_twins_agree_on_our_scenes(gl_context, path):
    """The relative RMSE is below 1e-4 for scenes of 0.1 m, 5 m and 50 m."""
    assert scene_twin_error(path, gl_context) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("name", OUTSIDE_SCENES)
def test_twins_agree_on_scenes_of_others(gl_context, scenes_folder, name):
    """The relative RMSE is below 1e-3, the bound for any scene; most are below 1e-5."""
    assert scene_twin_error(outside_scene(scenes_folder, name), gl_context) < 1e-3


@pytest.mark.parametrize("config", [WITHOUT_MAPS, WITHOUT_MAPS.with_parameters(DISCS[1])])
@pytest.mark.parametrize("light", ["spot", "directional"])
def test_factored_gather_equals_its_definition(gl_context, light, config):
    """Axis by axis and pair by pair agree to a relative RMSE of 1e-4: float32 in another order."""
    captured = Runtime(colored_room(), context=gl_context).capture(room_view(light, (32, 24)), config)
    receivers, vpls = gather_inputs(captured)
    for parameters in map(FalloffParameters.of, POINTS):
        pairwise = np.asarray(gather_pairwise(receivers, vpls, parameters))
        assert relative_rms(np.asarray(gather(receivers, vpls, parameters)), pairwise) < 1e-4


@pytest.mark.parametrize("light", ["spot", "directional"])
def test_tabulated_gather_is_close(gl_context, light):
    """In the range where fits end, interpolation between nodes errs by less than 0.2 % relative RMSE."""
    config = WITHOUT_MAPS.with_parameters(point_vpls(vpl_count=1024))
    captured = Runtime(colored_room(), context=gl_context).capture(room_view(light, (32, 24)), config)
    receivers, vpls = gather_inputs(captured)
    table = tabulate_gather(receivers, vpls)
    for alpha in (0.05, 0.5, 1.0, 3.0):
        for kappa in (0.0, 0.5, 2.0):
            parameters = FalloffParameters(*map(jnp.float32, (1.7, alpha, kappa)))
            exact = np.asarray(gather(receivers, vpls, parameters))
            assert relative_rms(np.asarray(gather_tabulated(table, parameters)), exact) < 2e-3


@pytest.mark.parametrize("light", ["spot", "directional"])
def test_tabulated_gather_of_discs_is_close(gl_context, light):
    """The error is below 4 % for 32 discs, whose edges cross receivers between nodes of α; 0.3 % at α = 1."""
    config = replace(WITHOUT_MAPS.with_parameters(DISCS[1]), light=ONE_BOUNCE)
    captured = Runtime(colored_room(), context=gl_context).capture(room_view(light, (32, 24)), config)
    receivers, vpls = gather_inputs(captured)
    assert vpls.cells
    table = tabulate_gather(receivers, vpls)
    for alpha in (0.5, 0.8, 1.0, 1.2, 1.6):
        for kappa in (0.0, 0.5, 2.0):
            parameters = FalloffParameters(*map(jnp.float32, (1.7, alpha, kappa)))
            exact = np.asarray(gather(receivers, vpls, parameters))
            error = relative_rms(np.asarray(gather_tabulated(table, parameters)), exact)
            assert error < (3e-3 if alpha == 1.0 else 4e-2), (alpha, kappa)


def test_hidden_vpls_give_nothing(gl_context):
    """A visibility mask removes exactly its pairs, in the full and in the tabulated gather."""
    runtime = Runtime(colored_room(), context=gl_context)
    captured = runtime.capture(room_view("spot", (32, 24)), WITHOUT_MAPS)
    receivers, vpls = gather_inputs(captured)
    parameters = FalloffParameters.of(ArtistParameters())
    shape = (len(receivers.position), len(vpls.position))
    mask = np.random.default_rng(0).random(shape) < 0.5
    whole = np.asarray(gather(receivers, vpls, parameters))
    parts = [np.asarray(gather(receivers, vpls, parameters, jnp.asarray(half))) for half in (mask, ~mask)]
    np.testing.assert_allclose(parts[0] + parts[1], whole, rtol=1e-4, atol=1e-6 * float(whole.max()))
    table = np.asarray(gather_tabulated(tabulate_gather(receivers, vpls, mask), parameters))
    assert relative_rms(table, parts[0]) < 3e-3


def test_nothing_lit_is_finite():
    """Without VPL flux the twins return zeros, not NaN."""
    floor = colored_room()
    camera = Camera(look_at(np.array([0.0, 0.0, 3.6]), np.zeros(3)), 0.7)
    away = Light("spot", np.ones(3), np.array([0.0, 0.0, 3.0]), np.array([0.0, 0.0, 1.0]), 0.1, 0.3)
    view = View("dark", "fitted", (16, 12), camera, (away,))
    captured = Runtime(floor).capture(view, TunedConfig(ArtistParameters(vpl_count=64)))
    receivers, vpls = gather_inputs(captured)
    assert not np.asarray(gather(receivers, vpls, FalloffParameters.of(ArtistParameters()))).any()
    assert not np.asarray(
        gather_tabulated(tabulate_gather(receivers, vpls), FalloffParameters.of(ArtistParameters()))
    ).any()


@pytest.mark.parametrize("vpls", [1, 3, 1_000, 70_000, 2**21])
def test_pairs_at_once_are_bounded(vpls):
    """A chunk has at most the given number of pairs, or a single receiver, and at least a quarter of them."""
    receivers = receivers_at_once(vpls, PAIRS_AT_ONCE)
    assert receivers >= 1
    assert receivers == 1 or PAIRS_AT_ONCE / 4 < receivers * vpls <= PAIRS_AT_ONCE


def test_chunks_do_not_show():
    """Few receivers and very many VPLs, gathered and tabulated in chunks, give the same as in one piece."""
    random = np.random.default_rng(5)
    receivers, vpls = corner(random, 37, 20_000)
    parameters = FalloffParameters.of(ArtistParameters())
    exact = np.asarray(gather_pairwise(receivers, vpls, parameters))
    assert relative_rms(np.asarray(gather(receivers, vpls, parameters)), exact) < 1e-5
    assert (
        relative_rms(np.asarray(gather_tabulated(tabulate_gather(receivers, vpls), parameters)), exact) < 2e-3
    )
