"""Decides on validation views whether a fit is better than its start, and keeps the start if it is not.

The runtime draws every candidate in views that it was not fitted to. For each measure, log(candidate/start)
is averaged over the views; its upper bound is Student's one-sided bound at confidence `CONFIDENCE`. A
candidate is accepted if

- the bound of at least one of `MEASURES` is below `LEAST_GAIN`,
- no measure, flicker included, has a bound or a ratio of means over the views above `TOLERANCE`, and
- the mean of |1 − energy ratio| grows by at most `ENERGY_TOLERANCE`.

relMSE and FLIP are both measures, so a gain in one cannot be paid for with the other.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, stdev

from scipy.special import stdtrit

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.metrics.view_metrics import ViewMetrics

MEASURES = ("relmse", "trimmed_relmse", "median_error", "flip")
"""Measures that a candidate is judged by; flicker is added if it was measured."""
WORDS = {
    "relmse": "relMSE",
    "trimmed_relmse": "trimmed relMSE",
    "median_error": "median pixel error",
    "flip": "FLIP",
    "flicker": "flicker",
}
CONFIDENCE = 0.9
"""Confidence of a measure's bound. A choice, made before measuring."""
TOLERANCE = 1.02
"""Ratio to the start up to which a measure counts as not worse. A choice, made before measuring: what a fit
promises on views that it did not see."""
LEAST_GAIN = 0.99
"""Ratio to the start below which a measure counts as better. A choice: less than 1 % is not worth a
change."""
ENERGY_TOLERANCE = 0.01
"""Most that the mean of |1 − energy ratio| over the views may grow. A choice."""
UNSEEN = {"relmse": 1e-5, "trimmed_relmse": 1e-5, "median_error": 1e-3, "flip": 1e-3, "flicker": 1e-3}
"""Added to both sides of a ratio, so that invisible errors do not decide. A choice: 0.1 % error in the median
pixel, 0.3 % root mean square in relMSE, and a FLIP of 0.001."""
CHOSEN = {
    "placement": "; chosen: the tuned placement, with the falloff that the fit started from",
    "halfway": "; chosen: halfway to the tuned parameters",
    "auto": "; chosen: the parameters that `auto` sets",
}
"""End of an accepted fit's sentence if the choice is not the tuned parameters."""
PREFERRED = 0.99
"""A candidate replaces a simpler one if its score is below this share of the other's. A choice."""


@dataclass(frozen=True)
class Judgement:
    """One candidate compared with the start."""

    name: str
    parameters: ArtistParameters
    ratios: dict[str, float]
    """candidate/start by measure, the geometric mean over the views; below 1 is better."""
    bounds: dict[str, float]
    """Upper bound of each ratio at confidence `CONFIDENCE`."""
    energy_change: float
    """Change of the mean of |1 − energy ratio|; below 0 is better."""
    means_worse: dict[str, float]
    """Ratio of the measure's means over the views, for measures in which it is above `TOLERANCE`."""

    @property
    def better(self) -> tuple[str, ...]:
        """Names of the measures whose bound is below `LEAST_GAIN`."""
        return tuple(name for name in MEASURES if self.bounds[name] < LEAST_GAIN)

    @property
    def worse(self) -> tuple[str, ...]:
        """Measures that may be worse, in words, with the ratio that they may reach."""
        measures = [
            f"{WORDS[name]} up to ×{max(self.bounds[name], self.means_worse.get(name, 0.0)):.2f}"
            for name in self.bounds
            if self.bounds[name] > TOLERANCE or name in self.means_worse
        ]
        if self.energy_change > ENERGY_TOLERANCE:
            measures.append(f"energy error up by {self.energy_change:.2f}")
        return tuple(measures)

    @property
    def accepted(self) -> bool:
        """Whether the candidate is better in at least one measure and worse in none."""
        return bool(self.better) and not self.worse

    @property
    def score(self) -> float:
        """Geometric mean of the ratios over `MEASURES`; below 1 is better."""
        return math.exp(fmean(math.log(self.ratios[name]) for name in MEASURES))


@dataclass(frozen=True)
class Verdict:
    """What validation chose."""

    chosen: Judgement | None
    """None keeps the start."""
    judgements: tuple[Judgement, ...]
    """All candidates whose measures are finite."""
    sentence: str
    """The reason, for the user."""

    def document(self) -> dict[str, object]:
        """The key `validation` of metrics.json."""
        return {
            "chosen": "start" if self.chosen is None else self.chosen.name,
            "tolerance": TOLERANCE,
            "confidence": CONFIDENCE,
            "candidates": [
                {
                    "name": each.name,
                    "parameters": each.parameters.as_dict(),
                    "ratios": each.ratios,
                    "bounds": each.bounds,
                    "energy_change": each.energy_change,
                    "accepted": each.accepted,
                }
                for each in self.judgements
            ],
        }


def verdict(
    start: Sequence[ViewMetrics],
    candidates: Mapping[str, tuple[ArtistParameters, Sequence[ViewMetrics]]],
) -> Verdict:
    """Choose among candidates.

    Args:
        start: metrics of the start in each lit validation view; two or more.
        candidates: parameters, and metrics in the same views, by name, the simplest first.
    """
    if not _finite(start):
        return Verdict(None, (), "the start's images contain NaN or infinity; the start is kept")
    judged = tuple(
        judgement(name, parameters, start, metrics)
        for name, (parameters, metrics) in candidates.items()
        if _finite(metrics)
    )
    chosen: Judgement | None = None
    for each in judged:
        if each.accepted and (chosen is None or each.score < PREFERRED * chosen.score):
            chosen = each
    return Verdict(chosen, judged, _sentence(chosen, judged, len(start)))


def _finite(metrics: Sequence[ViewMetrics]) -> bool:
    return all(math.isfinite(getattr(each, name)) for each in metrics for name in (*MEASURES, "energy_ratio"))


def judgement(
    name: str, parameters: ArtistParameters, start: Sequence[ViewMetrics], metrics: Sequence[ViewMetrics]
) -> Judgement:
    """Compare one candidate with the start over the same views, two or more; all metrics must be finite."""
    ratios, bounds, means_worse = {}, {}, {}
    flickers = all(math.isfinite(each.flicker) for each in (*start, *metrics))
    for measure in (*MEASURES, "flicker") if flickers else MEASURES:
        unseen = UNSEEN[measure]
        pairs = [(getattr(a, measure), getattr(b, measure)) for a, b in zip(start, metrics, strict=True)]
        logs = [math.log((after + unseen) / (before + unseen)) for before, after in pairs]
        student = float(stdtrit(len(logs) - 1, CONFIDENCE))
        ratios[measure] = math.exp(fmean(logs))
        bounds[measure] = math.exp(fmean(logs) + student * stdev(logs) / math.sqrt(len(logs)))
        before, after = (fmean(values) + unseen for values in zip(*pairs, strict=True))
        if after > TOLERANCE * before:
            means_worse[measure] = after / before
    energy = fmean(abs(1.0 - each.energy_ratio) for each in metrics) - fmean(
        abs(1.0 - each.energy_ratio) for each in start
    )
    return Judgement(name, parameters, ratios, bounds, energy, means_worse)


def _sentence(chosen: Judgement | None, judged: Sequence[Judgement], views: int) -> str:
    if chosen is not None:
        figures = ", ".join(f"{WORDS[name]} ×{chosen.ratios[name]:.2f}" for name in MEASURES)
        return f"better than the start on {views} validation views: {figures}{CHOSEN.get(chosen.name, '')}"
    if not judged:
        return "no candidate differs from the start; the start is kept"
    best = min(judged, key=lambda each: each.score)
    why = f"{best.name} may be worse in {', '.join(best.worse)}" if best.worse else "no gain is beyond chance"
    return (
        f"on {views} validation views, no candidate is better than the start in one measure and worse in "
        f"none ({why}); the start is kept"
    )
