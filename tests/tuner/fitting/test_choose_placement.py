"""Where many VPLs stand is chosen by drawn images; candidates lie between what a fit began with and its
end."""

from dataclasses import replace

import pytest
from built_scenes import colored_room
from converged_views import converged_view
from point_vpls import point_vpls

from vpltune.renderer.config.artist_parameters import LARGEST_DISC_COUNT, ArtistParameters, placement
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.tuner.evaluation.validation import between, candidates
from vpltune.tuner.fitting.choose_placement import IMPORTANCES, choose_placement, placement_name
from vpltune.tuner.fitting.fit_views import robust_errors
from vpltune.tuner.surrogate.captured_view import CapturedView, capture_views

START = point_vpls(vpl_count=64)
CONFIG = TunedConfig(START, quality=Quality(rsm_resolution=128), light=ONE_BOUNCE)


@pytest.mark.slow
def test_discs_beat_points_in_a_corner(gl_context):
    """Beside 16,384 VPLs as the truth: the chosen placement has less cost, and its views are drawn with
    it."""
    runtime = Runtime(colored_room(), context=gl_context)
    truth = [converged_view(runtime, light, CONFIG) for light in ("spot", "point", "wide_spot")]
    views = capture_views(runtime, CONFIG, tuple(v.view for v in truth), tuple(v.reference for v in truth))
    chosen = choose_placement(runtime, views, CONFIG, robust_errors(views))
    discs = {f"discs λ=2 γ=1 η={importance:g}" for importance in IMPORTANCES}
    assert set(chosen.costs) == {"points γ=1 η=0", *discs}
    assert chosen.costs[placement_name(chosen.parameters)] == min(chosen.costs.values()) < 1.0
    assert [view.view for view in chosen.views] == [view.view for view in views]
    assert all(view.drawn_with == CONFIG.with_parameters(chosen.parameters) for view in chosen.views)


@pytest.mark.slow
def test_a_start_that_is_best_keeps_its_views(gl_context):
    """Its own images are the reference: nothing is better."""
    runtime = Runtime(colored_room(), context=gl_context)
    view = converged_view(runtime, "spot", CONFIG)
    (drawn,) = capture_views(runtime, CONFIG, (view.view,), (view.reference,))
    perfect = replace(
        view.reference,
        irradiance_a=drawn.captured.indirect_irradiance,
        irradiance_b=drawn.captured.indirect_irradiance,
    )
    own = CapturedView(view.view, perfect, drawn.captured, CONFIG)
    chosen = choose_placement(runtime, (own,), CONFIG, robust_errors((own,)))
    assert chosen.parameters == START
    assert chosen.views == (own,)


def test_a_placement_is_named_after_what_is_drawn():
    """More VPLs than can be clustered are points, whatever the config asks for."""
    names = [placement_name(ArtistParameters(vpl_count=LARGEST_DISC_COUNT + more)) for more in (0, 1)]
    assert names == ["discs λ=2 γ=1 η=0.5", "points γ=1 η=0.5"]


def test_candidates_are_the_placement_halfway_and_tuned():
    """Halfway on each parameter's own scale; what equals the start, or another, is not tried twice."""
    base = replace(START, lloyd_iterations=2, falloff_footprint=1.0)
    tuned = replace(base, intensity=4.0, extinction_coefficient=1.0)
    half = between(base, tuned, 0.5)
    assert half.intensity == pytest.approx(2.0)
    assert half.extinction_coefficient == pytest.approx(0.5)
    assert placement(half) == placement(tuned)
    assert list(candidates(START, base, tuned, None)) == ["placement", "halfway", "tuned"]
    assert list(candidates(START, START, START, None)) == []
    assert list(candidates(START, base, base, replace(START, intensity=1.1))) == ["placement", "auto"]
