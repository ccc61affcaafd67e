"""Surfaces with holes: the camera sees through them, light passes, and the reference has the same holes."""

import numpy as np
import pytest
from card_over_floor import card_over_floor, checkered, view_down, view_of_ceiling

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import scaled
from vpltune.renderer.scene.views import scaled_view
from vpltune.tuner.reference import reference_views

FEW = TunedConfig(ArtistParameters(vpl_count=256), light=ONE_BOUNCE)
CARD = card_over_floor("mask", texture=checkered())


@pytest.fixture(scope="module")
def reference_below():
    (reference,) = reference_views(CARD, (view_down(0.45),), noise_target=1e-3, max_samples=512, bounces=1)
    return reference


def test_the_camera_sees_half_of_a_checkered_card(gl_context):
    """Of the pixels that show the card, half show the floor: to 2 %, since edges of texels cross pixels."""
    view = view_down(3.0)
    frame = Runtime(CARD, context=gl_context).capture(view, FEW)
    x, height, z = np.moveaxis(frame.position_world, -1, 0)
    # The card's middle, and the floor behind it: seen from 3 m, the floor is 3/2.5 times as far out.
    middle = np.maximum(np.abs(x), np.abs(z)) < 0.75 * np.where(height > 0.25, 1.0, 1.2)
    assert (height[middle] > 0.25).mean() == pytest.approx(0.5, abs=0.02)
    (reference,) = reference_views(CARD, (view,), noise_target=1.0, max_samples=1, bounces=1)
    # Both take the texture at the pixel's centre. The hardware's filter has eight bits: at some 1 % of the
    # pixels, an edge is nearer than that.
    differs = np.abs(reference.position_world[..., 1] - height) > 0.25
    assert differs.mean() < 0.02


def test_light_passes_the_holes_alone(gl_context, reference_below):
    """Half of 3 W/m² on the floor below, to 3 % for the edges of shadows; and where the reference has it."""
    frame = Runtime(CARD, context=gl_context).capture(view_down(0.45), FEW)
    direct = frame.direct_irradiance[..., 0]
    assert direct.mean() == pytest.approx(1.5, rel=0.03)
    assert reference_below.direct_irradiance.mean() == pytest.approx(1.5, rel=0.03)
    # The edges of 8² fields: each is blurred over a texel of the RSM.
    assert np.abs(direct - reference_below.direct_irradiance[..., 0]).mean() < 0.1


def test_light_of_a_lit_floor_passes_the_holes(gl_context):
    """The ceiling sees the lamp's light on the floor through the card alone: the reference's mean, to 8 %.

    With a card without holes it sees none.
    """
    scene = card_over_floor("mask", texture=checkered(), has_ceiling=True)
    view = view_of_ceiling()
    (reference,) = reference_views(scene, (view,), noise_target=1e-3, max_samples=1024, bounces=1)
    frame = Runtime(scene, context=gl_context).capture(view, TunedConfig(light=ONE_BOUNCE))
    expected = reference.irradiance.mean()
    assert expected > 0.01
    assert frame.indirect_irradiance.mean() == pytest.approx(expected, rel=0.08)
    whole = card_over_floor("opaque", has_ceiling=True)
    frame = Runtime(whole, context=gl_context).capture(view, TunedConfig(light=ONE_BOUNCE))
    assert frame.indirect_irradiance.max() < 1e-3 * expected


@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_scale_changes_nothing(gl_context, factor):
    """To 2e-3 relative RMSE, as for scenes without holes."""
    view = view_down(0.45)
    image = Runtime(CARD, context=gl_context).render_radiance(view, FEW)
    grown = Runtime(scaled(CARD, factor), context=gl_context).render_radiance(scaled_view(view, factor), FEW)
    assert np.sqrt(np.mean((grown - image) ** 2) / np.mean(image**2)) < 2e-3
