"""Whether a fit's intervals are calibrated: how often they contain the truth of planted problems."""

from collections.abc import Callable

from benchmarks.harness.row import Row
from vpltune.tuner.fitting.planted_problem import interval_coverage
from vpltune.tuner.fitting.uncertainty import CONFIDENCE
from vpltune.tuner.surrogate.compiled_functions import keep_compiled_functions

PROBLEMS = 50
"""Planted problems. A choice: 150 independent intervals have a standard error of 0.025 at a share of 0.9."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Shares of planted values that lie in their intervals, against the stated confidence.

    `calibration_all` counts all intervals, `calibration_<parameter>` those of one parameter, and
    `calibration_determined` those of parameters that the fit calls determined.
    """
    keep_compiled_functions()
    coverage = interval_coverage(PROBLEMS, lambda share: progress("calibration", share))
    contains, determined = coverage.contains, coverage.determined
    against = f"stated; {PROBLEMS} problems, {contains.size} intervals"
    return [
        Row("calibration_all", float(contains.mean()), "1", against, CONFIDENCE),
        *(
            Row(f"calibration_{name}", float(contains[:, axis].mean()), "1", against, CONFIDENCE)
            for axis, name in enumerate(coverage.names)
        ),
        Row(
            "calibration_determined",
            float(contains[determined].mean()),
            "1",
            f"stated; {int(determined.sum())} of {contains.size}",
            CONFIDENCE,
        ),
    ]
