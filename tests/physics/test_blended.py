"""Surfaces that let a share of the light pass, as direct light, from VPLs and in the reference."""

import numpy as np
import pytest
from card_over_floor import card_over_floor, view_down, view_of_ceiling

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import scaled
from vpltune.renderer.scene.views import scaled_view
from vpltune.tuner.reference import reference_views
from vpltune.tuner.reference.reference_view import ReferenceView

FEW = TunedConfig(ArtistParameters(vpl_count=256), light=ONE_BOUNCE)
ROTATIONS = ((0.0, 0.0), (0.3, 0.7), (0.6, 0.1), (0.15, 0.45))


def mean_and_error(reference: ReferenceView) -> tuple[float, float]:
    """The mean of the indirect irradiance, and its standard error from the difference of the halves."""
    half = np.abs(reference.irradiance_a - reference.irradiance_b).mean() / 2.0
    return float(reference.irradiance.mean()), float(half) / np.sqrt(reference.valid.sum())


@pytest.mark.parametrize(("opacity", "cards"), [(0.1, 1), (0.7, 1), (0.3, 2)])
def test_direct_light_passes_by_its_share(gl_context, opacity, cards):
    """(1 − a) of 3 W/m² for each card, in both renderers, to 1e-4: the rounding of float32 products."""
    scene = card_over_floor("blend", opacity, cards=cards)
    expected = 3.0 * (1.0 - opacity) ** cards
    frame = Runtime(scene, context=gl_context).capture(view_down(0.45, (16, 16)), FEW)
    np.testing.assert_allclose(frame.direct_irradiance, expected, rtol=1e-4)
    (reference,) = reference_views(
        scene, (view_down(0.45, (16, 16)),), noise_target=1.0, max_samples=1, bounces=1
    )
    np.testing.assert_allclose(reference.direct_irradiance, expected, rtol=1e-4)


@pytest.mark.parametrize(("opacity", "is_seen"), [(0.4, False), (0.6, True)])
def test_the_camera_sees_what_is_half_opaque(gl_context, opacity, is_seen):
    """And a card that it sees has its light in full: 3 W/m², to rounding."""
    scene = card_over_floor("blend", opacity)
    view = view_down(3.0, (16, 16))
    frame = Runtime(scene, context=gl_context).capture(view, FEW)
    middle = frame.position_world[8, 8, 1]
    assert middle == pytest.approx(0.5 if is_seen else 0.0, abs=1e-3)
    (reference,) = reference_views(scene, (view,), noise_target=1.0, max_samples=1, bounces=1)
    assert reference.position_world[8, 8, 1] == pytest.approx(middle, abs=1e-3)
    expected = 3.0 if is_seen else 3.0 * (1.0 - opacity)
    assert frame.direct_irradiance[8, 8, 0] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("opacity", [0.1, 0.5, 0.9])
def test_the_reflected_flux_is_shared_out(gl_context, opacity):
    """Over floor and card, 3 W/m² · area · albedo, the card stopping its share: to 3e-3.

    Of the card's texels, some 2⁸ · 2⁸, those that stop light are drawn by chance: 2e-3 of the card's flux at
    one standard deviation, and the border is a texel wide.
    """
    scene = card_over_floor("blend", opacity)
    drawn = Runtime(scene, context=gl_context).draw(view_down(3.0, (16, 16)), FEW)
    flux = np.frombuffer(drawn.frame.resources.read("frame_statistics"), np.float32)[1]
    expected = 3.0 * (12.0 * 0.8 + 4.0 * (opacity * 0.5 + (1.0 - opacity) * 0.8))
    assert flux == pytest.approx(expected, rel=3e-3)


@pytest.mark.parametrize(("opacity", "cards"), [pytest.param(0.3, 1, marks=pytest.mark.slow), (0.3, 2)])
def test_light_of_a_lit_floor_passes_by_its_share(gl_context, opacity, cards):
    """The ceiling sees the lamp's light on the floor through the cards alone.

    The reference lets (1 − a) of each through, to 4 standard errors. So does the runtime, to 3 %: some
    hundred VPLs count, each of them hidden or not.
    """
    view = view_of_ceiling()
    through, open_ = (card_over_floor("blend", a, cards=cards, has_ceiling=True) for a in (opacity, 0.0))
    share = (1.0 - opacity) ** cards
    means = []
    for scene in (through, open_):
        (reference,) = reference_views(scene, (view,), noise_target=3e-4, max_samples=1024, bounces=1)
        means.append(mean_and_error(reference))
    (found, error), (whole, whole_error) = means
    assert abs(found - share * whole) < 4.0 * np.hypot(error, share * whole_error)
    drawn = []
    for scene in (through, open_):
        frames = Runtime(scene, context=gl_context).captures(view, TunedConfig(light=ONE_BOUNCE), ROTATIONS)
        drawn.append(np.mean([frame.indirect_irradiance.mean() for frame in frames]))
    assert drawn[0] == pytest.approx(share * drawn[1], rel=0.03)


@pytest.mark.parametrize("factor", [2.0**-7, 2.0**7])
def test_scale_changes_nothing(gl_context, factor):
    """To 2e-3 relative RMSE, as for other scenes: which texels and rays pass does not depend on lengths."""
    scene, view = card_over_floor("blend", 0.3, has_ceiling=True), view_of_ceiling((24, 24))
    image = Runtime(scene, context=gl_context).render_radiance(view, FEW)
    grown = Runtime(scaled(scene, factor), context=gl_context).render_radiance(scaled_view(view, factor), FEW)
    assert np.sqrt(np.mean((grown - image) ** 2) / np.mean(image**2)) < 2e-3
