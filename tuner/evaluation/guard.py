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

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.metrics.view_metrics import ViewMetrics

MEASURES = ("relmse", "trimmed_relmse", "median_error", "flip")
"""What a candidate is judged by; by its flicker too, where that was measured."""
WORDS = {
    "relmse": "relMSE",
    "trimmed_relmse": "trimmed relMSE",
    "median_error": "median pixel error",
    "flip": "FLIP",
    "flicker": "flicker",
}
CONFIDENCE = 0.9
TOLERANCE = 1.02
"""Ratio to the start up to which a measure counts as not worse: what a fit promises on views that chose
nothing."""
LEAST_GAIN = 0.99
"""Ratio to the start below which a measure counts as better. A choice: less than 1 % is not worth a
change."""
ENERGY_TOLERANCE = 0.01
"""What the mean of |1 − energy ratio| over the views may grow by."""
UNSEEN = {"relmse": 1e-5, "trimmed_relmse": 1e-5, "median_error": 1e-3, "flip": 1e-3, "flicker": 1e-3}
"""Added to both sides of a ratio, so that errors too small to see do not decide. A choice: 0.1 % of error
in the median pixel, 0.3 % root mean square in relMSE, and a FLIP of 0.001."""
CHOSEN = {
    "placement": "; chosen: the placement, with the falloff that its fit began with",
    "halfway": "; chosen: halfway to the tuned parameters",
    "auto": "; chosen: what `auto` sets",
}
"""What the sentence of an accepted fit says where it is not the tuned parameters."""
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
    means_worse: dict[str, float]
    """The ratio of the means over views, of measures in which it is above TOLERANCE whatever single views
    say."""

    @property
    def better(self) -> tuple[str, ...]:
        """Measures that are better by `LEAST_GAIN` beyond their margin."""
        return tuple(name for name in MEASURES if self.bounds[name] < LEAST_GAIN)

    @property
    def worse(self) -> tuple[str, ...]:
        """Measures that may be worse, in words with the ratio that they may reach."""
        measures = [
            f"{WORDS[name]} up to ×{max(self.bounds[name], self.means_worse.get(name, 0.0)):.2f}"
            for name in self.bounds
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
        return math.exp(fmean(math.log(self.ratios[name]) for name in MEASURES))


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
    if not _finite(start):
        return Verdict(None, (), "the start's images hold what is no number; the start is kept")
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
    """One candidate against the start over the same views, two or more."""
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
        return "nothing differs from the start; the start is kept"
    best = min(judged, key=lambda each: each.score)
    why = f"{best.name} may be worse in {', '.join(best.worse)}" if best.worse else "no gain is beyond chance"
    return (
        f"no candidate is better than the start on {views} validation views and worse in nothing ({why}); "
        "the start is kept"
    )
