"""Fits a scene to a frame's time, or to the whole front of error against time, and writes its files."""

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
from vpltune.tuner.frame_time.pareto_front import fit_front

_COLUMNS = ("milliseconds", "relmse", "vpl_count")


@dataclass(frozen=True)
class BudgetOptions:
    """A frame's time, or the front of error against time, or both.

    Raises:
        ValueError: neither is asked for, or the time is not a positive number.
    """

    milliseconds: float | None
    pareto: bool = False
    frame_size: tuple[int, int] | None = None
    """Of the frames that are timed; None takes the views' own."""

    def __post_init__(self) -> None:
        if self.milliseconds is None and not self.pareto:
            raise ValueError("milliseconds: must be given where no front is asked for, got None")
        if self.milliseconds is not None and not 0.0 < self.milliseconds < math.inf:
            raise ValueError(f"milliseconds: must be positive and finite, got {self.milliseconds!r}")


def fit_to_budget(
    prepared: PreparedScene,
    start: TunedConfig,
    options: BudgetOptions,
    output: Path,
    *,
    seed: int = 0,
    progress: Callable[[float], None] = lambda share: None,
) -> tuple[TunedConfig, Descent, dict[str, Any]]:
    """The config that meets a budget, and the keys `budget` and `pareto` of metrics.json.

    A front's configs, table and plot are written into `output`; where no time is asked for, the front's most
    exact point is what is returned.

    Raises:
        InputError: no frame is as fast as asked for.
    """
    size = options.frame_size or prepared.views[0].view.size
    budget = FrameBudget(prepared, start, size, seed=seed, progress=lambda share: progress(0.1 * share))
    found: dict[str, Any] = {}
    best: BudgetFit | None = None
    begin = 0.1
    if options.milliseconds is not None:
        end = 0.3 if options.pareto else 1.0
        best = budget.fit(options.milliseconds, lambda share: progress(0.1 + (end - 0.1) * share))
        found["budget"] = {"frame_size": list(size), **best.document()}
        begin = end
    if options.pareto:
        points = fit_front(budget, lambda share: progress(begin + (1.0 - begin) * share))
        found["pareto"] = write_front(output, points, start, size)
        best = best or points[-1]
    assert best is not None, "options ask for neither"
    return best.config(start), best.descent, found


def write_front(
    output: Path, points: Sequence[BudgetFit], start: TunedConfig, frame_size: tuple[int, int]
) -> list[dict[str, Any]]:
    """Write pareto/<n>.json, pareto.csv and pareto.png into `output`; returns `pareto` of metrics.json.

    Configs of an earlier front are removed: it may have had more points.
    """
    for earlier in output.glob("pareto/[0-9]*.json"):
        earlier.unlink()
    rows = []
    for index, point in enumerate(points):
        name = f"pareto/{index}.json"
        provenance = {"milliseconds": point.frame.milliseconds}
        write_config(output / name, replace(point.config(start), provenance=provenance, fit=None))
        document = {"frame_size": list(frame_size), **point.document()}
        rows.append({**document, "parameters": point.parameters.as_dict(), "config": name})
    lines = [",".join((*_COLUMNS, *CHOICES, "config"))]
    for row in rows:
        cells = [f"{row[name]:.6g}" for name in _COLUMNS] + [str(row["choice"][name]) for name in CHOICES]
        lines.append(",".join((*cells, row["config"])))
    write_text_whole(output / "pareto.csv", "\n".join(lines) + "\n")
    write_plot(output / "pareto.png", points)
    return rows


def write_plot(path: Path, points: Sequence[BudgetFit]) -> None:
    """Error against milliseconds, both logarithmic, each point with its VPL count."""
    # Here: a plot is asked for seldom, and matplotlib takes half a second to load.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = figure.subplots()
    milliseconds = [point.frame.milliseconds for point in points]
    errors = [point.relmse for point in points]
    axes.loglog(milliseconds, errors, "o-")
    for x, y, point in zip(milliseconds, errors, points, strict=True):
        axes.annotate(f" {point.frame.vpl_count} VPLs", (x, y), va="bottom")
    axes.set(xlabel="frame [ms]", ylabel="relMSE on rotations not fitted to")
    axes.margins(x=0.15)
    axes.grid(which="both", alpha=0.3)
    with written_whole(path) as temporary:
        figure.savefig(temporary, dpi=120)
