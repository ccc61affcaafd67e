"""What a learnt prior contributes to a fit: its start, a candidate, and the metrics of a start with one."""

from collections.abc import Sequence
from dataclasses import replace
from statistics import fmean

import numpy as np

from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS
from vpltune.renderer.config.tuned_config import TunedConfig, read_config
from vpltune.tuner.evaluation.prepare_scene import PreparedScene
from vpltune.tuner.metrics.view_metrics import ViewMetrics
from vpltune.tuner.surrogate.captured_view import CapturedView


def fit_start(config: TunedConfig, drawn: Sequence[ArtistParameters]) -> ArtistParameters:
    """The parameters that a fit starts from: the config's, or the mean of those that its prior set.

    Args:
        config: the start.
        drawn: parameters that the views were drawn with; at least one if the config has a prior.
    """
    return config.parameters if config.auto is None else _mean_parameters(config.parameters, drawn)


def auto_candidate(
    prepared: PreparedScene, start: TunedConfig, given: TunedConfig
) -> ArtistParameters | None:
    """The parameters that the shipped prior sets for the start's placement: the mean over the fitted views.

    None if the prior was not trained for this start, which has points or no visibility maps, or if the start
    has a prior itself.

    Args:
        prepared: its fitted views have scene statistics.
        start: what the fit starts from, without a prior.
        given: the config that the fit was asked to start from.
    """
    parameters = start.parameters
    if not parameters.vpls_are_discs or given.visibility != "maps" or given.auto is not None:
        return None
    prior = read_config("auto").auto
    statistics = [
        view.statistics
        for view in prepared.views
        if view.view.split == "fitted"
        and view.statistics is not None
        and view.drawn_with is not None
        and view.drawn_with.parameters == parameters
    ]
    if prior is None or not statistics:
        return None
    set_by_view = [prior.parameters(each.astype(np.float64), parameters) for each in statistics]
    return _mean_parameters(parameters, set_by_view)


def prior_metrics(prepared: PreparedScene, start: TunedConfig) -> list[ViewMetrics]:
    """Metrics of a start with a prior, which sets the parameters anew in each validation view."""
    runtime = prepared.runtime
    drawn = [
        CapturedView(view, reference, runtime.capture(view, start, maps=False))
        for view, reference in prepared.validation
    ]
    return [view.metrics(view.captured.indirect_irradiance) for view in drawn if view.lit]


def _mean_parameters(rest: ArtistParameters, drawn: Sequence[ArtistParameters]) -> ArtistParameters:
    """Mean of the parameters that a prior sets, each on its own scale; all others are those of `rest`."""
    values = {}
    for name in AUTO_PARAMETERS:
        spec = parameter_spec(name)
        values[name] = spec.within(fmean(spec.place_of(getattr(each, name)) for each in drawn))
    return replace(rest, **values)
