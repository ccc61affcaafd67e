"""Fits a scene to a frame-time budget, or fits a Pareto front of error against frame time."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from vpltune.renderer.config.tuned_config import TunedConfig, write_config
from vpltune.renderer.files.atomic_file import write_text_whole, written_whole
from vpltune.tuner.evaluation.prepare_scene import PreparedScene
from vpltune.tuner.fitting.fit_status import Descent
from vpltune.tuner.frame_time.frame_budget import CHOICES, BudgetFit, FrameBudget
from vpltune.tuner.frame_time.pareto_front import fit_front, forget_front

_COLUMNS = ("milliseconds", "relmse", "vpl_count")


@dataclass(frozen=True)
class BudgetOptions:
    """A frame-time budget, a Pareto front of error against frame time, or both.

    Raises:
        ValueError: there is neither, or the budget is not a positive finite number.
    """

    milliseconds: float | None
    """The frame-time budget; None asks for the front only."""
    pareto: bool = False
    """Whether to fit a front."""
    frame_size: tuple[int, int] | None = None
    """Width and height of the timed frames, in pixels; None takes the size of the views."""

    def __post_init__(self) -> None:
        if self.milliseconds is None and not self.pareto:
            raise ValueError("milliseconds: must be given unless pareto is True, got None")
        if self.milliseconds is not None and not 0.0 < self.milliseconds < math.inf:
            raise ValueError(f"milliseconds: must be positive and finite, got {self.milliseconds!r}")


def fit_to_budget(
    prepared: PreparedScene,
    start: TunedConfig,
    options: BudgetOptions,
    *,
    seed: int = 0,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[TunedConfig, Descent, dict[str, Any], "Front | None"]:
    """Fit a scene to a frame-time budget.

    Args:
        prepared: the scene; at least one of its fitted views is lit.
        start: where the fit begins; has no prior.
        options: budget, front and frame size.
        seed: selects pixels and rotations.
        progress: called with the share done, in [0, 1].

    Returns:
        The config that meets the budget, or without one the point of the front with the least error; its
        descent; the keys `budget` and `pareto` of metrics.json; and the front, if there is one.

    Raises:
        InputError: no frame is as fast as the budget.
        MachineError: the GPU ran out of memory or reported an error.
    """
    size = options.frame_size or prepared.views[0].view.size
    budget = FrameBudget(prepared, start, size, seed=seed, progress=lambda share: progress(0.1 * share))
    found: dict[str, Any] = {}
    best: BudgetFit | None = None
    front: Front | None = None
    begin = 0.1
    if options.milliseconds is not None:
        end = 0.3 if options.pareto else 1.0
        best = budget.fit(options.milliseconds, lambda share: progress(0.1 + (end - 0.1) * share))
        found["budget"] = {"frame_size": list(size), **best.document()}
        begin = end
    if options.pareto:
        points = fit_front(budget, lambda share: progress(begin + (1.0 - begin) * share))
        front = Front(points, start, size, budget.content_key())
        found["pareto"] = front.rows()
        best = best or points[-1]
    assert best is not None, "options ask for neither"
    return best.config(start), best.descent, found, front


FRONT_FILES = ("pareto.csv", "pareto.png", "pareto/[0-9]*.json")
"""Patterns of all that `Front.write` writes."""


@dataclass(frozen=True, eq=False)
class Front:
    """A Pareto front, and how its files are written."""

    points: Sequence[BudgetFit]
    """By rising frame time."""
    start: TunedConfig
    """Where the fits began."""
    frame_size: tuple[int, int]
    """Width and height of the timed frames, in pixels."""
    content_key: str
    """The budget's key (`FrameBudget.content_key`); its fits are in the cache until the files are written."""

    def rows(self) -> list[dict[str, Any]]:
        """The key `pareto` of metrics.json."""
        return [
            {
                "frame_size": list(self.frame_size),
                **point.document(),
                "parameters": point.parameters.as_dict(),
                "config": f"pareto/{index}.json",
            }
            for index, point in enumerate(self.points)
        ]

    def write(self, folder: Path) -> None:
        """Write pareto/<n>.json, pareto.csv and pareto.png to `folder`.

        Raises:
            InputError, MachineError: `folder` cannot be written to.
        """
        lines = [",".join((*_COLUMNS, *CHOICES, "config"))]
        for point, row in zip(self.points, self.rows(), strict=True):
            provenance = {"milliseconds": point.frame.milliseconds}
            config = replace(point.config(self.start), provenance=provenance, fit=None)
            write_config(folder / row["config"], config)
            cells = [f"{row[name]:.6g}" for name in _COLUMNS] + [str(row["choice"][name]) for name in CHOICES]
            lines.append(",".join((*cells, row["config"])))
        write_text_whole(folder / "pareto.csv", "\n".join(lines) + "\n")
        write_plot(folder / "pareto.png", self.points)

    def forget(self) -> None:
        """Remove the saved fits of an interrupted search. Call it once the files are in their folder."""
        forget_front(self.content_key)


def write_plot(path: Path, points: Sequence[BudgetFit]) -> None:
    """Plot error against frame time on logarithmic axes, each point with its VPL count.

    Raises:
        InputError: the path cannot be written to.
    """
    # Imported here, because matplotlib takes half a second to load and few fits plot.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    milliseconds = [point.frame.milliseconds for point in points]
    errors = [point.relmse for point in points]
    axes.loglog(milliseconds, errors, "o-")
    for x, y, point in zip(milliseconds, errors, points, strict=True):
        axes.annotate(f" {point.frame.vpl_count} VPLs", (x, y), va="bottom")
    axes.set(xlabel="frame time [ms]", ylabel="relMSE on held-out rotations")
    axes.margins(x=0.15)
    axes.grid(which="both", alpha=0.3)
    with written_whole(path) as temporary:
        figure.savefig(temporary, dpi=120)
