"""What validation accepts: better in one measure and worse in none, with a margin from the views' spread."""

from dataclasses import replace

import numpy as np
import pytest

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.evaluation.guard import MEASURES, judgement, verdict
from vpltune.tuner.metrics.view_metrics import ViewMetrics

START = ViewMetrics(
    relmse=0.02, trimmed_relmse=0.01, worst_share=0.5, median_error=0.03, energy_ratio=0.99, flip=0.05
)
PARAMETERS = ArtistParameters()


def scaled(factors, **measures) -> list[ViewMetrics]:
    """Views with every measure times a factor of their own, and some of them times more."""
    return [
        replace(START, **{name: getattr(START, name) * factor * measures.get(name, 1.0) for name in MEASURES})
        for factor in factors
    ]


def judged(metrics, start=None):
    return judgement("tuned", PARAMETERS, [START] * len(metrics) if start is None else start, metrics)


def test_a_gain_in_every_view_is_accepted():
    verdict_ = judged(scaled([0.7, 0.8, 0.75, 0.72]))
    assert verdict_.accepted
    assert verdict_.better == MEASURES
    assert verdict_.score == pytest.approx(0.741, abs=0.01)


def test_the_same_gain_in_one_view_alone_is_chance():
    """The mean ratio is 0.74 as well, but three of four views do not show it."""
    assert not judged(scaled([0.3, 1.0, 1.0, 1.0])).accepted


@pytest.mark.parametrize("measure", MEASURES)
def test_no_measure_is_bought_with_another(measure):
    """Everything 30 % better but one, which is 5 % worse: refused, and the measure is named."""
    found = judged(scaled([0.7, 0.71, 0.69, 0.7], **{measure: 1.5}))
    assert not found.accepted
    assert len(found.worse) == 1


def test_a_mean_that_one_view_raises_is_worse_however_the_others_fare():
    """Three views gain half, one has thirty times the relMSE: the geometric mean is no cover for it."""
    metrics = scaled([0.5] * 7)
    metrics.append(replace(metrics[0], relmse=30.0 * START.relmse))
    found = judged(metrics)
    assert found.ratios["relmse"] < 1.0
    assert "relmse" in found.means_worse
    assert not found.accepted


def test_energy_may_not_leave_one():
    """Half the error with 5 % of the energy gone: refused."""
    metrics = [replace(view, energy_ratio=0.94) for view in scaled([0.5] * 4)]
    found = judged(metrics)
    assert found.worse == ("energy error up by 0.05",)
    assert not found.accepted


def test_what_is_equal_is_not_better():
    """And what differs by less than anyone sees is neither better nor worse."""
    assert not judged(scaled([1.0] * 4)).better
    unseen = replace(START, relmse=1e-9, trimmed_relmse=1e-9, median_error=1e-7, flip=1e-7)
    found = judged([replace(unseen, relmse=1e-8, flip=1e-6)] * 3, start=[unseen] * 3)
    assert not found.worse
    assert not found.better or found.score == pytest.approx(1.0, abs=1e-3)


def test_the_simplest_of_equals_is_chosen_and_the_start_where_nothing_is_accepted():
    views = [0.6, 0.62, 0.61, 0.6]
    candidates = {
        "placement": (PARAMETERS, scaled(views)),
        "tuned": (PARAMETERS, scaled([0.999 * each for each in views])),
    }
    found = verdict([START] * 4, candidates)
    assert found.chosen is not None
    assert found.chosen.name == "placement"
    assert "relMSE ×0.61" in found.sentence
    better = candidates | {"tuned": (PARAMETERS, scaled([0.9 * each for each in views]))}
    chosen = verdict([START] * 4, better).chosen
    assert chosen is not None
    assert chosen.name == "tuned"
    worse = verdict([START] * 4, {"tuned": (PARAMETERS, scaled([1.1] * 4))})
    assert worse.chosen is None
    assert "may be worse in relMSE up to ×1.10" in worse.sentence
    assert worse.sentence.endswith("the start is kept")
    assert verdict([START] * 4, {}).chosen is None


def test_chance_is_seldom_taken_for_a_gain():
    """Candidates that change nothing but for 20 % of noise in each view: at most 2 % of 500 are accepted.

    One measure passes in a tenth of them; that none of the other three may look worse leaves a few.
    """
    random = np.random.default_rng(3)
    accepted = 0
    for _ in range(500):
        metrics = [
            replace(
                START,
                **{
                    name: getattr(START, name) * float(np.exp(0.2 * random.standard_normal()))
                    for name in MEASURES
                },
            )
            for _ in range(4)
        ]
        accepted += judged(metrics).accepted
    assert accepted <= 0.02 * 500


def test_what_is_no_number_is_not_accepted():
    """A candidate with NaN is passed over; a start with NaN is kept, with the reason."""
    broken = replace(START, relmse=float("nan"))
    assert verdict([START] * 3, {"tuned": (PARAMETERS, [START, START, broken])}).judgements == ()
    assert "NaN or infinity" in verdict([broken] * 3, {"tuned": (PARAMETERS, [START] * 3)}).sentence
