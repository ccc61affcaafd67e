"""Decides on validation views whether a fit is better than its start, and keeps the start where it is not.

Every candidate is drawn by the runtime in views that it was not fitted to. For each measure, the logarithm of
candidate over start in each view is averaged over the views, with a margin from its spread: Student's
one-sided bound with CONFIDENCE. A candidate is accepted where at least one measure is better beyond its
margin, none may be worse than TOLERANCE within it, and the energy is no farther from 1 by more than
ENERGY_TOLERANCE. relMSE and FLIP are both among the measures, so neither is bought with the other.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean, stdev

from scipy.special import stdtrit

from renderer.artist_parameters import ArtistParameters
from tuner.view_metrics import ViewMetrics

MEASURES = ("relmse", "trimmed_relmse", "median_error", "flip")
WORDS = {
    "relmse": "relMSE",
    "trimmed_relmse": "trimmed relMSE",
    "median_error": "median pixel error",
    "flip": "FLIP",
}
CONFIDENCE = 0.9
TOLERANCE = 1.02
"""Ratio to the start up to which a measure counts as not worse: what a fit promises on views that chose
nothing."""
ENERGY_TOLERANCE = 0.01
"""Of |1 − energy ratio|, the mean over views."""
UNSEEN = {"relmse": 1e-5, "trimmed_relmse": 1e-5, "median_error": 1e-3, "flip": 1e-3}
"""Added to both sides of a ratio: errors as small as these are not seen, and their ratios say nothing. A
tenth of a per cent of error in the median pixel; relMSE as (0.3 %)²; the least difference that FLIP's
authors call visible is some fifty times this."""
PREFERRED = 0.99
"""Score from which on a candidate takes the place of an earlier, simpler one."""


@dataclass(frozen=True)
class Judgement:
    """One candidate against the start."""

    name: str
    parameters: ArtistParameters
    ratios: dict[str, float]
    """Geometric mean over views of candidate over start, by measure."""
    bounds: dict[str, float]
    """The ratio that each measure stays below with CONFIDENCE."""
    energy_change: float
    """Change of the mean of |1 − energy ratio|; below 0 is better."""
    means_worse: tuple[str, ...]
    """Measures whose mean over views is above TOLERANCE times the start's, whatever the single views say."""

    @property
    def better(self) -> tuple[str, ...]:
        """Measures that are better beyond their margin."""
        return tuple(name for name in MEASURES if self.bounds[name] < 1.0)

    @property
    def worse(self) -> tuple[str, ...]:
        """Measures that may be worse, in words with the ratio that they may reach."""
        measures = [
            f"{WORDS[name]} up to ×{self.bounds[name]:.2f}"
            for name in MEASURES
            if self.bounds[name] > TOLERANCE or name in self.means_worse
        ]
        if self.energy_change > ENERGY_TOLERANCE:
            measures.append(f"energy off by {self.energy_change:.2f} more")
        return tuple(measures)

    @property
    def accepted(self) -> bool:
        """Better in one measure and worse in none."""
        return bool(self.better) and not self.worse

    @property
    def score(self) -> float:
        """Geometric mean of the ratios."""
        return math.exp(fmean(math.log(ratio) for ratio in self.ratios.values()))


@dataclass(frozen=True)
class Verdict:
    """What validation chose."""

    chosen: Judgement | None
    """None keeps the start."""
    judgements: tuple[Judgement, ...]
    sentence: str

    def document(self) -> dict[str, object]:
        """What metrics.json says of it."""
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
    """Choose among candidates, the simplest first.

    Args:
        start: metrics of the start in each validation view that light reaches; two or more.
        candidates: parameters and metrics in the same views, by name.
    """
    judged = tuple(
        judgement(name, parameters, start, metrics) for name, (parameters, metrics) in candidates.items()
    )
    chosen: Judgement | None = None
    for each in judged:
        if each.accepted and (chosen is None or each.score < PREFERRED * chosen.score):
            chosen = each
    return Verdict(chosen, judged, _sentence(chosen, judged, len(start)))


def judgement(
    name: str, parameters: ArtistParameters, start: Sequence[ViewMetrics], metrics: Sequence[ViewMetrics]
) -> Judgement:
    """One candidate against the start over the same views, two or more."""
    ratios, bounds, means_worse = {}, {}, []
    for measure in MEASURES:
        unseen = UNSEEN[measure]
        pairs = [(getattr(a, measure), getattr(b, measure)) for a, b in zip(start, metrics, strict=True)]
        logs = [math.log((after + unseen) / (before + unseen)) for before, after in pairs]
        student = float(stdtrit(len(logs) - 1, CONFIDENCE))
        ratios[measure] = math.exp(fmean(logs))
        bounds[measure] = math.exp(fmean(logs) + student * stdev(logs) / math.sqrt(len(logs)))
        before, after = (fmean(values) + unseen for values in zip(*pairs, strict=True))
        if after > TOLERANCE * before:
            means_worse.append(measure)
    energy = fmean(abs(1.0 - each.energy_ratio) for each in metrics) - fmean(
        abs(1.0 - each.energy_ratio) for each in start
    )
    return Judgement(name, parameters, ratios, bounds, energy, tuple(means_worse))


def _sentence(chosen: Judgement | None, judged: Sequence[Judgement], views: int) -> str:
    if chosen is not None:
        figures = ", ".join(f"{WORDS[name]} ×{chosen.ratios[name]:.2f}" for name in MEASURES)
        return f"better than the start on {views} validation views: {figures}"
    if not judged:
        return "nothing differs from the start; the start is kept"
    best = min(judged, key=lambda each: each.score)
    why = f"{best.name} may be worse in {', '.join(best.worse)}" if best.worse else "no gain is beyond chance"
    return (
        f"no candidate is better than the start on {views} validation views and worse in nothing ({why}); "
        "the start is kept"
    )
