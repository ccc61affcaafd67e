"""What a clip keeps of importance: nothing stirs with the camera, and a cut is followed at once."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.frame.drawn_frame import DrawnFrame
from vpltune.renderer.frame.passes.vpl_importance import LARGEST_LAG
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.light_faces import light_records
from vpltune.renderer.scene.sun_faces import SunGrid
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View

SIZE = (32, 24)


def discs(density_importance: float) -> TunedConfig:
    """128 discs from a small RSM, without visibility, which has nothing to do with where they stand."""
    parameters = ArtistParameters(vpl_count=128, density_importance=density_importance)
    return TunedConfig(
        parameters, visibility="transmittance", quality=Quality(rsm_resolution=128), light=ONE_BOUNCE
    )


@pytest.fixture(scope="module")
def room(gl_context) -> Runtime:
    return Runtime(colored_room(), context=gl_context)


def seen_from(x: float, light: str = "spot", ahead: float = 0.0) -> View:
    """The room from `x` beside its middle, with the camera turned to the wall at `ahead`."""
    view = room_view(light, SIZE)
    to_world = look_at(np.array([x, 0.0, 3.6]), np.array([ahead, 0.0, 0.0]))
    return replace(view, camera=replace(view.camera, to_world=to_world))


def factors(drawn: DrawnFrame) -> tuple[np.ndarray, np.ndarray]:
    """F and flux of each importance cell."""
    resources = drawn.frame.resources
    cells = np.frombuffer(resources.read("importance_cells"), np.float32).reshape(-1, 8)
    return np.frombuffer(resources.read("vpl_importance"), np.float32), cells[:, 3]


def disc_flux(drawn: DrawnFrame) -> np.ndarray:
    """Flux of each disc and channel [W]: the last vec4 of its record, without padding."""
    records = np.frombuffer(drawn.frame.resources.read("virtual_point_lights"), np.float32)
    return records.reshape(-1, 12)[:, 8:11]


def lag(factor: np.ndarray, other: np.ndarray, flux: np.ndarray) -> float:
    """Share of the VPLs that the two factors draw in different places."""
    weights = [flux.astype(np.float64) * one for one in (factor, other)]
    first, second = (each / each.sum() for each in weights)
    return 0.5 * float(np.abs(first - second).sum())


@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_a_clip_starts_as_a_still_and_a_camera_at_rest_stirs_nothing(room, light):
    """To the last bit, for every kind of light."""
    view, state = seen_from(0.3, light), ClipState()
    still, _ = factors(room.draw(view, discs(0.5)))
    for _ in range(3):
        np.testing.assert_array_equal(factors(room.draw(view, discs(0.5), state))[0], still)


def test_a_clip_is_never_far_from_a_still(room):
    """The camera moves slowly and fast. Each frame has the F of the frame before, or that of a still.

    Wherever the camera stops, the clip's F is there within `LARGEST_LAG` of a still's; 1e-5 is for sums in
    float32. Both happen on the way.
    """
    state, before, kept = ClipState(), None, []
    for x in (0.0, 0.01, 0.02, 0.3, 0.6, 0.9, 1.2, 1.21, -1.2, -1.19):
        view = seen_from(x, ahead=-x)
        still, flux = factors(room.draw(view, discs(1.0)))
        clip, _ = factors(room.draw(view, discs(1.0), state))
        assert lag(clip, still, flux) <= LARGEST_LAG + 1e-5
        kept.append(before is not None and np.array_equal(clip, before))
        assert kept[-1] or np.array_equal(clip, still)
        before = clip
    assert kept[1] and kept[2] and not all(kept[1:])


def test_cuts_are_followed_in_their_first_frame(room):
    """After a cut of the camera F is that of a still, to the last bit; likewise after one of the light.

    The cuts draw 0.2 and 0.3 of the VPLs elsewhere or more, so none is within `LARGEST_LAG`.
    """
    spot = ROOM_LIGHTS["spot"]
    start = seen_from(0.0)
    turned = replace(start, lights=(replace(spot, direction_world=-spot.direction_world),))
    close = look_at(np.array([0.9, 0.8, 0.8]), np.array([0.9, -1.0, -0.9]))
    for cut in (replace(start, camera=replace(start.camera, to_world=close)), turned):
        state = ClipState()
        before, _ = factors(room.draw(start, discs(1.0), state))
        still, flux = factors(room.draw(cut, discs(1.0)))
        assert lag(before, still, flux) > 1.5 * LARGEST_LAG, lag(before, still, flux)
        np.testing.assert_array_equal(factors(room.draw(cut, discs(1.0), state))[0], still)


def test_lights_that_move_or_come_and_go_are_followed(room):
    """Also through a dark frame, and with other numbers of faces: F is that of a still, to the last bit.

    F belongs to cells of the RSM, which move with their light. So it is measured anew while lights move.
    """
    state, spot = ClipState(), ROOM_LIGHTS["spot"]
    moved = replace(spot, position_world=spot.position_world + np.array([0.01, 0.0, 0.0]))
    others = (ROOM_LIGHTS[kind] for kind in ("point", "wide_spot", "spot", "directional"))
    for lights in ((spot,), (moved,), (), (moved,), *((each,) for each in others)):
        view = replace(seen_from(0.0), lights=lights)
        still, _ = factors(room.draw(view, discs(1.0)))
        np.testing.assert_array_equal(factors(room.draw(view, discs(1.0), state))[0], still)


def test_a_sun_stands_still_while_its_finer_faces_follow_the_eye():
    """They go with the camera by whole texels, over large ground; the light is the same."""
    sun, state = ROOM_LIGHTS["directional"], ClipState()
    bounds = np.array([[-50.0, 0.0, -50.0], [50.0, 4.0, 50.0]])
    here, there = (light_records((sun,), bounds, SunGrid(128, (x, 1.0, 0.0), 2, None)) for x in (0.0, 9.0))
    assert not np.array_equal(here.faces, there.faces)
    turned = replace(sun, direction_world=np.array([0.48, -0.64, -0.6]))
    moved = light_records((turned,), bounds, SunGrid(128, (9.0, 1.0, 0.0), 2, None))
    assert [state.lights_stand_still(each) for each in (here, there, moved)] == [False, True, False]


def test_a_moving_camera_does_not_stir_the_light(room):
    """While the camera creeps, discs keep their flux from frame to frame, once their clusters have settled.

    The light stands still. Change is the sum over discs of |ΔΦ| over the whole flux. Twelve frames of two
    iterations settle the clusters to 0.1 %; stills, which measure importance anew, change by more than 2 %.
    """
    state, drawn = ClipState(), {"clip": [], "stills": []}
    for frame in range(16):
        view = seen_from(0.004 * frame)
        drawn["clip"].append(disc_flux(room.draw(view, discs(0.5), state)))
        if frame >= 12:
            drawn["stills"].append(disc_flux(room.draw(view, discs(0.5))))
    change = {}
    for name, fluxes in drawn.items():
        last = np.array(fluxes[-4:], np.float64)
        change[name] = float((np.abs(np.diff(last, axis=0)).sum(axis=(1, 2)) / last[0].sum()).max())
    assert change["clip"] < 1e-3 < 2e-2 < change["stills"], change
