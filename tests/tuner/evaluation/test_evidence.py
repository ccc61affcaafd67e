"""Doubts about the views themselves: each kind is named, and good views raise none."""

from dataclasses import replace

import numpy as np
import pytest
from built_scenes import colored_room, room_view
from own_reference import own_reference

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import Camera
from vpltune.renderer.scene.transforms import look_at
from vpltune.tuner.evaluation.evidence import doubts, undetermined
from vpltune.tuner.fitting.uncertainty import Interval
from vpltune.tuner.surrogate.captured_view import CapturedView

FEW = TunedConfig(ArtistParameters(vpl_count=16), quality=Quality(rsm_resolution=128), light=ONE_BOUNCE)


@pytest.fixture(scope="module")
def runtime(gl_context):
    return Runtime(colored_room(), context=gl_context)


def seen(runtime, light="spot", camera=None, **reference) -> CapturedView:
    view = room_view(light)
    view = view if camera is None else replace(view, camera=camera)
    captured = runtime.capture(view, FEW)
    return CapturedView(view, replace(own_reference(captured), **reference), captured)


@pytest.fixture(scope="module")
def good(runtime):
    return seen(runtime)


def test_good_views_raise_no_doubt(good):
    assert doubts([good, good], [good, good, good]) == ()


def test_views_without_light_are_too_few_to_judge_by(runtime, good):
    dark = seen(runtime, light=None)
    (found,) = doubts([good], [good, dark, dark])
    assert found == "indirect light reaches only 1 of 3 validation views"


def test_a_handful_of_pixels_is_too_few(runtime, good):
    view = room_view("spot", size=(2, 2))
    captured = runtime.capture(view, FEW.with_parameters(ArtistParameters()))
    small = CapturedView(view, own_reference(captured), captured)
    (found,) = doubts([good], [small, small])
    assert found == "the validation views have only 8 lit pixels; at least 256 are needed"


def test_a_camera_against_a_wall_is_named(runtime, good):
    """A hundredth of the room's side from the back wall, where L is about the room's side."""
    camera = Camera(look_at(np.array([0.0, 0.2, -0.98]), np.array([0.0, 0.2, -1.0])), 0.9)
    close = seen(runtime, camera=camera)
    (found,) = doubts([close], [good, good])
    assert found.startswith(
        "the camera is too close to a surface or sees little of what is lit: the median depth of spot is 0.02"
    )


def test_a_reference_of_other_surfaces_is_named(runtime, good):
    """As if the near plane had cut away what the path tracer sees."""
    elsewhere = good.reference.position_world + np.array([0.0, 0.0, 1.0])
    other = seen(runtime, position_world=elsewhere)
    assert other.disagreement == 1.0
    found = doubts([good], [other, other])
    assert any("runtime and reference see different surfaces at 100%" in each for each in found)


def test_a_noisy_reference_is_named(runtime, good):
    """Halves apart by 40 % of their mean: a relMSE of about 0.04 by noise alone."""
    clean = good.reference.irradiance_a
    noisy = seen(
        runtime, irradiance_a=(0.8 * clean).astype(np.float32), irradiance_b=(1.2 * clean).astype(np.float32)
    )
    (found,) = doubts([noisy], [noisy, noisy])
    assert found.startswith("the references are too noisy: their noise alone is a relMSE of 0.0")


def test_parameters_that_the_views_leave_open_are_named():
    interval = Interval(1.0, 0.05, 20.0, True, ())
    known = {
        "intensity": replace(interval, determined=False, at_bound=20.0),
        "falloff_footprint": replace(interval, determined=False),
        "extinction_coefficient": replace(interval, low=0.0, high=0.1),
    }
    found = undetermined(known, ArtistParameters())
    assert found == (
        "intensity is not determined by these views: the fit ran to its bound 20; the config has 1",
        "falloff_footprint is not determined by these views: its interval is 0.05 to 20; the config has 1",
    )
