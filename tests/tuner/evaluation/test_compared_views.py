"""Which views the comparison shows, and what it says of them."""

import numpy as np
import pytest

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.tuner.evaluation.evaluate import EvaluatedView, Evaluation
from vpltune.tuner.metrics.view_metrics import ViewMetrics
from vpltune.tuner.surrogate.captured_view import CapturedView

DEFAULT = np.full((2, 2, 3), 0.5, np.float32)


def evaluated(ratio, default=1.0):
    """A view in which tuned has `ratio` of default's error; at 1, the same image."""
    images = {"default": DEFAULT, "tuned": DEFAULT * np.float32(ratio), "ceiling": DEFAULT}
    errors = {
        name: ViewMetrics(default * factor, default * factor, 0.0, 0.0, 1.0, 0.0)
        for name, factor in (("default", 1.0), ("tuned", ratio), ("ceiling", 1.0))
    }
    return EvaluatedView(
        CapturedView.__new__(CapturedView), TunedConfig(light=ONE_BOUNCE), images, errors, 0.0
    )


@pytest.mark.parametrize(
    ("ratios", "labels"),
    [
        ((0.9, 0.5, 0.8), [("gained most", 1), ("gained least", 0)]),
        ((0.9, 1.2, 0.8), [("gained most", 2), ("lost most", 1)]),
        ((0.9,), [("gained most", 0)]),
        ((1.0, 1.0), [("default kept", 0)]),
    ],
)
def test_labels_are_true(ratios, labels):
    views = tuple(evaluated(ratio) for ratio in ratios)
    shown = Evaluation(views, ArtistParameters()).most_and_least_gained()
    assert [(label, views.index(view)) for label, view in shown] == labels


def test_without_indirect_light_nothing_is_said_of_gains():
    views = (evaluated(1.0, default=0.0), evaluated(1.0, default=0.0))
    shown = Evaluation(views, ArtistParameters()).most_and_least_gained()
    assert shown == (("no indirect light", views[0]),)
