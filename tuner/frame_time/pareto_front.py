"""The Pareto front of error against frame time: fits over the range of useful budgets.

A point takes a whole fit, so each is saved in the user's cache as soon as it is done, and an interrupted
front resumes with its budgets. Once its files are written, a front is removed from the cache, so the next run
measures it again.
"""

import json
import statistics
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.cache_folder import cache_folder
from vpltune.tuner.fitting.fit_status import Descent, FitStatus
from vpltune.tuner.frame_time.frame_budget import BudgetFit, FrameBudget, Progress, SettledFrame

POINTS = 6
"""Number of budgets. A choice."""
DENSEST = 512
"""The largest budget is the time of a default frame with this many VPLs. A choice: more of them hardly change
the error."""
TURNS, FRAMES_A_TURN = 3, 3
"""Rounds in which all points are timed, and frames of each timing. A choice: a temporary load on the machine
then affects all points alike."""


def fit_front(budget: FrameBudget, progress: Progress | None = None) -> tuple[BudgetFit, ...]:
    """Fit all budgets, and return the Pareto front by rising frame time. Its fits stay in the cache.

    Raises:
        InputError: no budget could be met.
    """
    kept = _KeptFits(budget)
    points: list[BudgetFit] = []
    for index, milliseconds in enumerate(kept.budgets):

        def report(share: float, done: int = index) -> None:
            if progress is not None:
                progress((done + share) / len(kept.budgets))

        report(0.0)
        if index < len(kept.fits):
            points += kept.fits[index]
            continue
        try:
            kept.add((budget.fit(milliseconds, report),))
        except InputError:
            # The frame was slower than predicted: leave this budget out.
            if not points and milliseconds == kept.budgets[-1]:
                raise
            kept.add(())
        points += kept.fits[index]
    return pareto_front(_timed_in_turns(budget, points))


def forget_front(content_key: str) -> None:
    """Remove the saved fits of the front of a `FrameBudget` with this key."""
    _kept_path(content_key).unlink(missing_ok=True)


def pareto_front(points: Sequence[BudgetFit]) -> tuple[BudgetFit, ...]:
    """The fits that no other beats in both frame time and error, by rising frame time."""
    front: list[BudgetFit] = []
    for point in sorted(points, key=lambda point: (point.frame.milliseconds, point.relmse)):
        if not front or point.relmse < front[-1].relmse:
            front.append(point)
    return tuple(front)


def _timed_in_turns(budget: FrameBudget, points: Sequence[BudgetFit]) -> list[BudgetFit]:
    """The same fits with new frame times: medians over rounds in which all are timed."""
    taken: list[list[float]] = [[] for _ in points]
    for _ in range(TURNS):
        for times, point in zip(taken, points, strict=True):
            times.append(budget.milliseconds(point.frame.choice, point.parameters, FRAMES_A_TURN))
    return [
        replace(point, frame=replace(point.frame, milliseconds=statistics.median(times)))
        for times, point in zip(taken, points, strict=True)
    ]


def _budgets(budget: FrameBudget) -> list[float]:
    least = 1.1 * budget.least_milliseconds()
    most = max(4.0 * least, budget.costs.milliseconds(budget.default_choice, DENSEST))
    return [float(each) for each in np.geomspace(least, most, POINTS)]


def _kept_path(content_key: str) -> Path:
    return cache_folder() / "fronts" / f"{content_key}.json"


class _KeptFits:
    """The saved state of a front: its budgets, and for each finished one a fit, or none if it was not met."""

    def __init__(self, budget: FrameBudget):
        self._path = _kept_path(budget.content_key())
        self.fits: list[tuple[BudgetFit, ...]]
        try:
            document = json.loads(self._path.read_text(encoding="utf-8"))
            self.budgets = [float(each) for each in document["budgets"]]
            self.fits = [tuple(_read_fit(each) for each in fits) for fits in document["fits"]]
        except (OSError, ValueError, TypeError, KeyError, AttributeError):
            # No front was interrupted, or its file is damaged.
            self.budgets, self.fits = _budgets(budget), []

    def add(self, fits: tuple[BudgetFit, ...]) -> None:
        """Save the result of the next budget."""
        self.fits.append(fits)
        document = {
            "budgets": self.budgets,
            "fits": [[_fit_document(fit) for fit in each] for each in self.fits],
        }
        try:
            write_text_whole(self._path, json.dumps(document) + "\n")
        except (InputError, MachineError):
            return  # the cache cannot be written to: an interrupted front starts over


def _fit_document(fit: BudgetFit) -> dict[str, Any]:
    descent = fit.descent
    return {
        "budget": fit.budget,
        "frame": asdict(fit.frame),
        "predicted": fit.predicted,
        "parameters": fit.parameters.as_dict(),
        "descent": {
            "point": descent.point.tolist(),
            "loss": descent.loss,
            "start_loss": descent.start_loss,
            "losses": descent.losses.tolist(),
            "status": descent.status.name,
        },
        "relmse": fit.relmse,
        "frame_size": list(fit.frame_size),
        "machine": fit.machine,
    }


def _read_fit(document: dict[str, Any]) -> BudgetFit:
    descent = document["descent"]
    choice = Quality(**document["frame"]["choice"])
    return BudgetFit(
        document["budget"],
        SettledFrame(**{**document["frame"], "choice": choice}),
        document["predicted"],
        ArtistParameters(**document["parameters"]),
        Descent(
            np.array(descent["point"], np.float32),
            descent["loss"],
            descent["start_loss"],
            np.array(descent["losses"], np.float64),
            FitStatus[descent["status"]],
        ),
        document["relmse"],
        tuple(document["frame_size"]),
        document["machine"],
    )
