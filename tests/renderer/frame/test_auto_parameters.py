"""Parameters that follow the scene: what the GPU sets is what the prior says, eased over time in a clip."""

import dataclasses

import numpy as np
import pytest
from built_scenes import ROOM_LIGHTS, colored_room, room_view
from made_priors import made_prior

from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.frame.passes.auto_parameters import LARGEST_STEP
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import scaled
from vpltune.renderer.scene.views import scaled_view

BASE = ArtistParameters(vpl_count=64, screen_space_radius=5.0)
POINTS = dataclasses.replace(BASE, lloyd_iterations=0)
"""Clusters go on from frame to frame in a clip; points do not."""
QUALITY = Quality(map_size=8, rsm_resolution=128, adaptation_frames=2.0)
CONFIG = TunedConfig(BASE, visibility="maps", auto=made_prior(), quality=QUALITY, light=ONE_BOUNCE)
GENTLE = dataclasses.replace(CONFIG, auto=made_prior(strength=0.2))


@pytest.fixture(scope="module")
def runtime(gl_context) -> Runtime:
    return Runtime(colored_room(), context=gl_context)


def places(parameters: ArtistParameters) -> np.ndarray:
    values = parameters.as_dict()
    return np.array([parameter_spec(name).place_of(values[name]) for name in AUTO_PARAMETERS])


def drawn_places(runtime: Runtime, view, config=CONFIG, state: ClipState | None = None) -> np.ndarray:
    return places(runtime.draw(view, config, state).read_parameters())


@pytest.mark.parametrize("light", ROOM_LIGHTS)
def test_the_gpu_evaluates_the_prior(runtime, light):
    """To 1e-5 of an axis: tanh and pow of a driver are good to some 1e-6."""
    drawn = runtime.draw(room_view(light), CONFIG)
    found = drawn.read_parameters()
    statistics = drawn.read_statistics().astype(np.float64)
    np.testing.assert_allclose(places(found), CONFIG.auto.point(statistics), atol=1e-5)
    assert found.screen_space_radius == 5.0


def test_the_image_is_drawn_with_them(runtime):
    """The same as with the parameters that were read back, given by hand; to their float32."""
    image = runtime.render(room_view(), CONFIG, layer="irradiance")
    found = runtime.draw(room_view(), CONFIG).read_parameters()
    assert found != BASE
    by_hand = CONFIG.with_parameters(found)
    np.testing.assert_allclose(
        runtime.render(room_view(), by_hand, layer="irradiance"), image, rtol=1e-4, atol=1e-6
    )
    assert runtime.draw(room_view(), by_hand).read_parameters() == found
    plain = runtime.render(room_view(), CONFIG.with_parameters(BASE), layer="irradiance")
    assert np.abs(plain - image).max() > 0.05 * image.max()


def test_scale_changes_nothing(gl_context, runtime):
    """Scene and light ×0.01 and ×100: the same parameters, to 1e-3 of an axis."""
    plain = drawn_places(runtime, room_view())
    for factor in (0.01, 100.0):
        other = Runtime(scaled(colored_room(), factor), context=gl_context)
        np.testing.assert_allclose(drawn_places(other, scaled_view(room_view(), factor)), plain, atol=1e-3)


def test_a_still_takes_what_it_asks_for(runtime):
    """Whatever was drawn before, and however slowly a clip would follow."""
    for adaptation in (0.0, 2.0, 1e4):
        config = dataclasses.replace(
            CONFIG, quality=dataclasses.replace(QUALITY, adaptation_frames=adaptation)
        )
        first = drawn_places(runtime, room_view("spot"), config)
        assert np.abs(drawn_places(runtime, room_view("wide_spot"), config) - first).max() > 1e-3
        np.testing.assert_array_equal(drawn_places(runtime, room_view("spot"), config), first)


@pytest.mark.slow
def test_an_eased_frame_moves_by_little(runtime):
    """The first frame is exact; then no step is larger than the bound, each goes the target's way, and the
    target is reached."""
    gentle = dataclasses.replace(GENTLE, parameters=POINTS)
    start, goal = (drawn_places(runtime, room_view(light), gentle) for light in ("spot", "wide_spot"))
    assert np.abs(goal - start).max() > 4.0 * LARGEST_STEP
    state = ClipState()
    here = drawn_places(runtime, room_view("spot"), gentle, state)
    np.testing.assert_allclose(here, start, atol=1e-6)
    for _ in range(60):
        there = drawn_places(runtime, room_view("wide_spot"), gentle, state)
        # 2e-6: places are found again from float32 values.
        assert np.abs(there - here).max() <= LARGEST_STEP + 2e-6
        assert ((there - here) * (goal - here) >= -1e-9).all()
        here = there
    np.testing.assert_allclose(here, goal, atol=1e-4)


def test_a_clip_without_a_time_constant_follows_at_once(runtime):
    config = dataclasses.replace(CONFIG, quality=dataclasses.replace(QUALITY, adaptation_frames=0.0))
    config, state = dataclasses.replace(config, parameters=POINTS), ClipState()
    for light in ("spot", "wide_spot", "spot"):
        np.testing.assert_array_equal(
            drawn_places(runtime, room_view(light), config, state),
            drawn_places(runtime, room_view(light), config),
        )


def clip(runtime: Runtime, lights: list[str], between=lambda: None) -> np.ndarray:
    """The places of each frame of a clip of its own; `between` is called after each."""
    state, found = ClipState(), []
    for light in lights:
        found.append(drawn_places(runtime, room_view(light), GENTLE, state))
        between()
    return np.array(found)


def test_two_clips_do_not_affect_each_other(runtime):
    """Drawn in turn, frame by frame, each is bitwise what it is alone."""
    one, other = ["spot", *["wide_spot"] * 5], ["wide_spot", *["point"] * 5]
    alone, other_alone = clip(runtime, one), clip(runtime, other)
    assert np.abs(np.diff(alone, axis=0)).max() > 0.0
    states, found = (ClipState(), ClipState()), ([], [])
    for lights in zip(one, other, strict=True):
        for state, light, places_of in zip(states, lights, found, strict=True):
            places_of.append(drawn_places(runtime, room_view(light), GENTLE, state))
    np.testing.assert_array_equal(found[0], alone)
    np.testing.assert_array_equal(found[1], other_alone)


def test_what_is_drawn_between_two_frames_of_a_clip_leaves_it_alone(runtime):
    """Stills of the same set-up; and so many other set-ups that the clip's own frame is made anew."""
    lights = ["spot", *["wide_spot"] * 4]
    alone = clip(runtime, lights)

    def stills():
        runtime.draw(room_view("point"), GENTLE)
        for size in ((16, 12), (20, 12), (24, 12)):
            runtime.draw(room_view("point", size), CONFIG)

    np.testing.assert_array_equal(clip(runtime, lights, stills), alone)


def test_a_still_between_two_frames_of_a_clip_is_not_eased(runtime):
    still = drawn_places(runtime, room_view("wide_spot"), GENTLE)
    state = ClipState()
    drawn_places(runtime, room_view("spot"), GENTLE, state)
    eased = drawn_places(runtime, room_view("wide_spot"), GENTLE, state)
    assert np.abs(eased - still).max() > LARGEST_STEP
    np.testing.assert_array_equal(drawn_places(runtime, room_view("wide_spot"), GENTLE), still)


def test_a_clip_of_points_without_a_prior_is_a_row_of_stills(runtime):
    config, state = CONFIG.with_parameters(POINTS), ClipState()
    for light in ("spot", "point", "spot"):
        np.testing.assert_array_equal(
            runtime.render_radiance(room_view(light), config, state),
            runtime.render_radiance(room_view(light), config),
        )


def test_every_way_to_draw_takes_the_state(runtime):
    """The second frame of a clip is eased, whichever way it is drawn."""
    view, goal = room_view("spot"), room_view("wide_spot")
    still = runtime.render_radiance(goal, GENTLE)

    def eased(draw) -> np.ndarray:
        state = ClipState()
        runtime.draw(view, GENTLE, state)
        return draw(state)

    expected = eased(lambda state: runtime.render_radiance(goal, GENTLE, state))
    assert np.abs(expected - still).max() > 1e-4 * still.max()
    np.testing.assert_array_equal(
        eased(lambda state: runtime.render(goal, GENTLE, state, layer="irradiance")),
        eased(lambda state: runtime.capture(goal, GENTLE, state).indirect_irradiance),
    )
    shown = eased(lambda state: runtime.render(goal, GENTLE, state, exposure=1.0))
    np.testing.assert_array_equal(shown, runtime.display(expected, 1.0))


def test_darkness_has_parameters_too(runtime):
    assert np.isfinite(drawn_places(runtime, room_view(None))).all()
    assert not runtime.render(room_view(None), CONFIG, layer="irradiance").any()
