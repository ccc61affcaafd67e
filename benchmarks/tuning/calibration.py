"""Whether a fit's intervals keep their word: on planted problems, how often they hold the truth."""

from collections.abc import Callable

import numpy as np

from benchmarks.harness.row import Row
from benchmarks.tuning.planted_problems import planted_problem
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.fitting.uncertainty import CONFIDENCE, fit_with_intervals
from vpltune.tuner.surrogate.compiled_functions import keep_compiled_functions

PROBLEMS = 50


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """`calibration_all` and `calibration_<parameter>`: shares of planted values inside their intervals;
    `calibration_determined`: of those the fit calls determined."""
    keep_compiled_functions()
    held, determined = [], []
    for seed in range(PROBLEMS):
        progress("calibration", seed / PROBLEMS)
        problem = planted_problem(seed)
        _, _, intervals = fit_with_intervals(problem.views, ArtistParameters())
        truth = problem.planted.as_dict()
        held.append([interval.low <= truth[name] <= interval.high for name, interval in intervals.items()])
        determined.append([interval.determined for interval in intervals.values()])
    progress("calibration", 1.0)
    hits, told = np.array(held), np.array(determined)
    against = f"stated; {PROBLEMS} problems, {hits.size} intervals"
    return [
        Row("calibration_all", float(hits.mean()), "1", against, CONFIDENCE),
        *(
            Row(f"calibration_{name}", float(hits[:, axis].mean()), "1", against, CONFIDENCE)
            for axis, name in enumerate(intervals)
        ),
        Row(
            "calibration_determined",
            float(hits[told].mean()),
            "1",
            f"stated; {int(told.sum())} of {hits.size}",
            CONFIDENCE,
        ),
    ]
