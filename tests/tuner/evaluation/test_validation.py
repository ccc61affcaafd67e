"""Candidates are measured in validation views as the runtime draws them, each with its own config."""

from dataclasses import replace
from statistics import fmean

import pytest
from built_scenes import colored_room
from converged_views import converged_view

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.views import View
from vpltune.tuner.evaluation.validation import validation_metrics
from vpltune.tuner.surrogate.captured_view import CapturedView

START = TunedConfig(
    ArtistParameters(vpl_count=64),
    quality=Quality(interleave=2, map_size=8, rsm_resolution=128),
    light=ONE_BOUNCE,
)
ROTATIONS = ((0.0, 0.0), (0.3, 0.6))


def test_metrics_are_those_of_drawn_images(gl_context):
    """Means over rotations and over lit views alone, to the bit; a shared placement changes nothing."""
    runtime = Runtime(colored_room(), context=gl_context)
    lit = converged_view(runtime, "spot", START)
    dark = View("dark", "validation", lit.view.size, lit.view.camera, ())
    black = replace(
        lit.reference,
        irradiance_a=0.0 * lit.reference.irradiance_a,
        irradiance_b=0.0 * lit.reference.irradiance_b,
    )
    parameters = START.parameters
    configs = {
        "start": START,
        "brighter": START.with_parameters(replace(parameters, intensity=1.5)),
        "elsewhere": START.with_parameters(replace(parameters, density_exponent=0.0)),
    }
    views = ((lit.view, lit.reference), (dark, black))
    metrics, captured = validation_metrics(runtime, views, configs, ROTATIONS)
    assert [view.lit for view in captured] == [True, False]
    assert list(metrics) == list(configs)
    for name, config in configs.items():
        (found,) = metrics[name]
        drawn = [runtime.capture(lit.view, config, table_rotation=rotation) for rotation in ROTATIONS]
        of_rotations = [
            CapturedView(lit.view, lit.reference, each).metrics(each.indirect_irradiance) for each in drawn
        ]
        assert found.relmse == fmean(each.relmse for each in of_rotations)
        assert found.flip == pytest.approx(fmean(each.flip for each in of_rotations), rel=1e-6)


def test_candidates_of_one_quality_alone_share_vpls(gl_context):
    """Another quality draws other maps: that is refused, and not passed over."""
    runtime = Runtime(colored_room(), context=gl_context)
    lit = converged_view(runtime, "spot", START)
    configs = {"start": START, "finer": replace(START, quality=Quality(rsm_resolution=128))}
    with pytest.raises(ValueError, match="capture_variants: configs must be one or more with one placement"):
        validation_metrics(runtime, ((lit.view, lit.reference),), configs, ROTATIONS[:1])
