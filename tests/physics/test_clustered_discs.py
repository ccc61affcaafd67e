"""VPLs with the light of a cell: the same energy, on the surface, evener, and the same in any unit.

Without visibility, which has nothing to do with where they stand.
"""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, quad, room_view, scene_of
from converged_views import corner_view
from point_vpls import point_vpls

from vpltune.renderer.config.artist_parameters import LARGEST_DISC_COUNT
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import Camera, Light, scaled
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View, scaled_view
from vpltune.tuner.fitting.fit_density import DISC_FOOTPRINT


def config_with(**parameters) -> TunedConfig:
    """32 discs placed by flux alone, or with `lloyd_iterations` 0 points."""
    discs = {"vpl_count": 32, "lloyd_iterations": 4, "falloff_footprint": DISC_FOOTPRINT}
    form = discs if parameters.get("lloyd_iterations", 4) else {"vpl_count": 32}
    chosen = point_vpls(**{**form, **parameters})
    return TunedConfig(
        chosen, visibility="transmittance", quality=Quality(rsm_resolution=256), light=ONE_BOUNCE
    )


@pytest.fixture(scope="module")
def room(gl_context) -> Runtime:
    return Runtime(colored_room(), context=gl_context)


@pytest.mark.parametrize("light", ROOM_LIGHTS)
@pytest.mark.parametrize("vpl_count", [1, 32, 300])
def test_energy_is_kept(room, light, vpl_count):
    """All light of the samples is in some cell: total flux is that of points.

    With γ = 1, where every sample has the same share of it; to 0.1 %, what filtered colours leave to chance.
    """
    discs, points = (
        room.capture(room_view(light, (8, 8)), config_with(vpl_count=count, lloyd_iterations=iterations))
        for count, iterations in ((vpl_count, 3), (4096, 0))
    )
    np.testing.assert_allclose(discs.vpl_flux.sum(axis=0), points.vpl_flux.sum(axis=0), rtol=1e-3)
    assert discs.scene_length == points.scene_length


@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_vpls_stand_on_surfaces(room, light):
    """The middle of a cell is on a plane of the room, with that plane's normal; none goes round a corner."""
    captured = room.capture(room_view(light, (8, 8)), config_with(vpl_count=200))
    lit = captured.vpl_flux.sum(axis=1) > 0.0
    assert lit.mean() > 0.98
    position, normal = captured.vpl_position_world[lit], captured.vpl_normal_world[lit]
    on_wall = np.abs(np.abs(position) - 1.0).min(axis=1) < 2e-5
    board = colored_room().meshes[-1]
    on_board = np.abs((position - board.positions[0]) @ board.normals[0]) < 2e-5
    assert (on_wall | on_board).all()
    assert np.abs(position).max() < 1.0 + 2e-5
    along = np.abs(np.sum(position * normal, axis=1))
    np.testing.assert_allclose(along[on_wall & ~on_board], 1.0, atol=1e-4)


def test_one_cell_is_a_disc_of_the_same_spread(gl_context):
    """One VPL for a lit square of side a stands at its centre, with twice its variance, ℓ² = 2 · 2 · a²/12.

    Tolerance 1 %: the square's edges fall between RSM texels.
    """
    side = 0.8
    scene = scene_of([quad((0.1, 0, 0.2), (0, 0, side), (side, 0, 0))], [(0.5, 0.5, 0.5)])
    sun = Light("directional", np.full(3, 2.0), direction_world=np.array([0.0, -1.0, 0.0]))
    view = View(
        "square", "fitted", (8, 8), Camera(look_at(np.array([0.5, 2.0, 0.6]), np.zeros(3)), 0.8), (sun,)
    )
    captured = Runtime(scene, context=gl_context).capture(view, config_with(vpl_count=1))
    np.testing.assert_allclose(captured.vpl_position_world[0], (0.5, 0.0, 0.6), atol=5e-3)
    assert captured.vpl_footprint[0] == pytest.approx(side / np.sqrt(3.0), rel=1e-2)


def test_a_cell_around_a_hole_stands_beside_it(gl_context):
    """The middle of a lit frame is empty: its one VPL is on the frame all the same."""
    bars = [
        quad((-1, 0, -1), (0, 0, 2), (0.2, 0, 0)), quad((0.8, 0, -1), (0, 0, 2), (0.2, 0, 0)),
        quad((-0.8, 0, -1), (0, 0, 0.2), (1.6, 0, 0)), quad((-0.8, 0, 0.8), (0, 0, 0.2), (1.6, 0, 0)),
    ]  # fmt: skip
    sun = Light("directional", np.full(3, 2.0), direction_world=np.array([0.0, -1.0, 0.0]))
    view = View(
        "frame", "fitted", (8, 8), Camera(look_at(np.array([0.0, 3.0, 0.1]), np.zeros(3)), 0.8), (sun,)
    )
    scene = scene_of(bars, [(0.5, 0.5, 0.5)])
    captured = Runtime(scene, context=gl_context).capture(view, config_with(vpl_count=1))
    assert np.abs(captured.vpl_position_world[0, [0, 2]]).max() > 0.75


@pytest.mark.parametrize("light", ["spot", "directional"])
def test_less_error_than_points(room, light):
    """Near a corner, against 16,384 points: at most two thirds of the squared error of as many points."""
    view = corner_view(light)
    truth = room.render(view, config_with(vpl_count=16384, lloyd_iterations=0), layer="irradiance")
    rotations = [(float(u), float(v)) for u, v in np.random.default_rng(5).random((6, 2))]
    error = {}
    for count in (32, 256):
        for iterations in (0, 4):
            config = config_with(vpl_count=count, lloyd_iterations=iterations)
            frames = [frame.indirect_irradiance for frame in room.captures(view, config, rotations)]
            error[count, iterations] = np.mean((np.array(frames) - truth) ** 2)
    assert error[32, 4] < 0.67 * error[32, 0], error
    assert error[256, 4] < 0.67 * error[256, 0], error


@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_more_cells_keep_the_mean(room, light):
    """Doubling N moves the mean irradiance by less than 1 %."""
    view = room_view(light, (48, 36))
    means = []
    for count in (512, 1024):
        captured = room.capture(view, config_with(vpl_count=count))
        means.append(captured.indirect_irradiance[captured.valid].mean())
    assert means[1] == pytest.approx(means[0], rel=1e-2)


@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_cells_have_no_unit(gl_context, room, factor):
    """Scene, camera and light scaled together: the same image, to 1e-3 relative RMSE."""
    view = room_view("spot", (32, 24))
    image = room.render_radiance(view, config_with())
    other = Runtime(scaled(colored_room(), factor), context=gl_context)
    grown = other.render_radiance(scaled_view(view, factor), config_with())
    assert np.sqrt(np.mean((grown - image) ** 2) / np.mean(image**2)) < 1e-3


def test_discs_have_no_near_field(room):
    """They withhold nothing that it could give back."""
    view = room_view("spot", (32, 24))
    images = [
        room.render(view, config_with(screen_space_strength=strength), layer="irradiance")
        for strength in (0.0, 2.0)
    ]
    np.testing.assert_array_equal(*images)


def test_dark_and_very_many(room):
    """Without light all is black; beyond the largest count VPLs are points as they were."""
    dark = room.capture(room_view(None, (16, 12)), config_with())
    assert not dark.indirect_irradiance.any() and np.isfinite(dark.vpl_position_world).all()
    counts = (LARGEST_DISC_COUNT, LARGEST_DISC_COUNT + 1)
    most, more = (
        [
            room.capture(room_view("spot", (8, 8)), config_with(vpl_count=count, lloyd_iterations=iterations))
            for iterations in (0, 1)
        ]
        for count in counts
    )
    assert [captured.vpls_are_discs for captured in (*most, *more)] == [False, True, False, False]
    assert (most[0].vpl_position_world != most[1].vpl_position_world).any()
    np.testing.assert_array_equal(more[0].vpl_position_world, more[1].vpl_position_world)


def test_cells_steady_a_swept_light(room):
    """Under a light that creeps, irradiance from cells jumps no more from frame to frame than from points."""
    changes = {}
    for iterations in (0, 4):
        config = config_with(vpl_count=64, lloyd_iterations=iterations)
        images = []
        for step in range(16):
            place = np.array([0.1 + 0.004 * step, 0.9, 0.05])
            light = Light("spot", np.full(3, 4.0), place, np.array([0.0, -1.0, 0.0]), 0.3, 0.85)
            camera = room_view("spot").camera
            view = View("s", "fitted", (32, 24), camera, (light,))
            images.append(room.render(view, config, layer="irradiance"))
        second = np.diff(np.array(images, np.float64), n=2, axis=0)
        changes[iterations] = np.abs(second).mean() / np.mean(images)
    assert changes[4] < changes[0], changes


def test_a_clip_starts_as_a_still_and_goes_on_from_there(room):
    """Where nothing moves, two frames of λ = 2 are one frame of λ = 4, to the last bit."""
    view, state = room_view("spot", (8, 8)), ClipState()
    config = config_with(lloyd_iterations=2)
    first, second = (room.capture(view, config, state) for _ in range(2))
    for clip, still in (
        (first, room.capture(view, config)),
        (second, room.capture(view, config_with(lloyd_iterations=4))),
    ):
        np.testing.assert_array_equal(clip.vpl_position_world, still.vpl_position_world)
        np.testing.assert_array_equal(clip.vpl_flux, still.vpl_flux)


def test_a_clip_follows_a_cut(room):
    """The light jumps from wall to wall. Every VPL has samples again, and energy is that of a still.

    To 0.1 %, as in `test_energy_is_kept`.
    """
    spot = room_view("spot", (8, 8))
    light = spot.lights[0]
    turned = replace(spot, lights=(replace(light, direction_world=-light.direction_world),))
    config, state = config_with(vpl_count=200), ClipState()
    room.capture(spot, config, state)
    cut, still = room.capture(turned, config, state), room.capture(turned, config)
    assert (cut.vpl_flux.sum(axis=1) > 0.0).mean() > 0.95
    np.testing.assert_allclose(cut.vpl_flux.sum(axis=0), still.vpl_flux.sum(axis=0), rtol=1e-3)


def test_a_clip_is_steadier_than_stills(room):
    """A spot turns by 0.005 a frame. Stills cluster anew, and a clip changes at most two thirds as much.

    Change is counted beyond that of 4,096 points. 0.22 was seen.
    """
    spot = room_view("spot", (24, 18))
    light, axis = spot.lights[0], np.array([1.0, 0.0, 0.0])
    discs = config_with(vpl_count=128, lloyd_iterations=2)
    points = config_with(vpl_count=4096, lloyd_iterations=0)
    drawn: dict[str, list[np.ndarray]] = {"clip": [], "stills": [], "true": []}
    state = ClipState()
    for frame in range(24):
        direction = light.direction_world + 0.005 * frame * axis
        view = replace(spot, lights=(replace(light, direction_world=direction / np.linalg.norm(direction)),))
        drawn["clip"].append(room.render(view, discs, state, layer="irradiance"))
        drawn["stills"].append(room.render(view, discs, layer="irradiance"))
        drawn["true"].append(room.render(view, points, layer="irradiance"))
    # A clip's first frames are those of stills.
    change = {name: np.abs(np.diff(np.array(images[4:]), axis=0)).mean() for name, images in drawn.items()}
    assert change["clip"] - change["true"] < 0.67 * (change["stills"] - change["true"])
