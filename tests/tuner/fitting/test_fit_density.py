"""Density and falloff fitted to the error of few VPLs, on rotations of the point table."""

from dataclasses import replace

import pytest
from built_scenes import colored_room
from converged_views import MANY, converged_view
from point_vpls import point_vpls

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.tuner.fitting.fit_density import (
    fit_density,
    rotation_errors,
    table_rotations,
    view_rotations,
)
from vpltune.tuner.fitting.fit_status import FitStatus
from vpltune.tuner.surrogate.captured_view import CapturedView

FEW = TunedConfig(
    point_vpls(vpl_count=24),
    quality=Quality(map_size=8, map_refinement=1, rsm_resolution=128),
    light=ONE_BOUNCE,
)
"""With small visibility maps: the reference is an image of the runtime's own, which has them too."""


@pytest.fixture(scope="module")
def room(gl_context) -> tuple[Runtime, CapturedView]:
    runtime = Runtime(colored_room(), context=gl_context)
    return runtime, converged_view(runtime, "spot", FEW)


@pytest.mark.slow
def test_few_vpls_are_better_where_they_were_not_fitted_to(room):
    """On held-out rotations, 24 fitted VPLs have a third of the default's error, and beat 48 uniform ones."""
    runtime, view = room
    fit = fit_density(runtime, (view,), FEW, rotations=table_rotations(4, 0))
    rotations = table_rotations(16, 0, held_out=True)

    def error(parameters: ArtistParameters) -> float:
        config = FEW.with_parameters(parameters)
        return float(rotation_errors(runtime, (view,), config, rotations).mean())

    tuned = error(fit.parameters)
    assert tuned < 0.33 * error(FEW.parameters)
    assert tuned < 0.4 * error(point_vpls(vpl_count=48, density_exponent=0.0))
    assert fit.parameters.vpl_count == FEW.parameters.vpl_count
    assert fit.descent.loss == min(trial.loss for trial in fit.trials)


@pytest.mark.slow
def test_the_result_is_never_worse_than_the_start(room):
    """The start's own density is among the trials, whatever it is."""
    runtime, view = room
    start = point_vpls(vpl_count=16, density_exponent=0.8, density_importance=0.3)
    fit = fit_density(runtime, (view,), FEW.with_parameters(start), rotations=table_rotations(2, 0))
    own = [t for t in fit.trials if (t.density_exponent, t.density_importance) == (0.8, 0.3)]
    assert len(own) == 1
    assert fit.descent.loss <= own[0].loss


@pytest.mark.slow
def test_nothing_lit_is_a_status(gl_context):
    runtime = Runtime(colored_room(), context=gl_context)
    coarse = replace(FEW, quality=Quality(rsm_resolution=64))
    view = converged_view(runtime, "spot", coarse)
    dark = CapturedView(
        type(view.view)("dark", "fitted", view.view.size, view.view.camera, ()), view.reference, view.captured
    )
    fit = fit_density(runtime, (dark,), coarse, rotations=((0.0, 0.0),))
    assert fit.descent.status is FitStatus.NOTHING_LIT
    assert fit.parameters == FEW.parameters
    assert len(fit.trials) == 1


def test_rotations_are_common_and_held_out_ones_are_others():
    """The same seed gives the same ones; the first is what the runtime draws with."""
    fitted, held_out = table_rotations(8, 3), table_rotations(8, 3, held_out=True)
    assert fitted == table_rotations(8, 3)
    assert fitted[0] == (0.0, 0.0)
    assert not set(fitted) & set(held_out)
    assert table_rotations(8, 4)[1:] != fitted[1:]


def test_views_share_their_first_rotation_alone():
    """Which is the one that the runtime draws with; the same for every candidate."""
    rotations = table_rotations(4, 0)
    first, second, third = (view_rotations(rotations, index) for index in range(3))
    assert first == rotations
    assert second[0] == third[0] == (0.0, 0.0)
    assert len({*first, *second, *third}) == 10
    assert all(0.0 <= x < 1.0 for rotation in third for x in rotation)


def test_error_is_of_the_rotated_image(room):
    """Each rotation has an error of its own, and many VPLs have none against their own image."""
    runtime, view = room
    errors = rotation_errors(runtime, (view,), FEW, table_rotations(3, 0))
    assert errors.shape == (1, 3)
    assert len(set(errors.ravel())) == 3
    many = FEW.with_parameters(MANY)
    assert rotation_errors(runtime, (view,), many, ((0.0, 0.0),)).item() == pytest.approx(0.0, abs=1e-9)
