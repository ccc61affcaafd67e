"""How long a fit takes to come within 1 % of the best loss that anyone finds, against searches of today.

All continuous parameters are free: k, α, κ, β, σ, γ and η, of few VPLs with visibility maps and cells.
Everyone minimises relMSE, the searches by drawing every view with the real runtime at ROTATIONS rotations of
the point table, reading it back and comparing it. Ours is `tuner.fitting.fit_density` on the same views and
rotations, told to minimise relMSE as well and not its own robust error.

The surrogate does not know where VPLs will stand, so it takes the runtime's place for the first five of the
seven: a search with `_surrogate` has the placements that ours tried, in that order, each captured anew, and
looks for the five at each. What it finds is judged by the runtime. It tells what least squares are worth; the
rest is the surrogate's.

Few rotations reward luck: a search that tries many placements ends at one that happens to suit the point
table. So everything that a search kept on its way is judged once more, by its relMSE at rotations that nobody
was given: the rows `…_held_out` say when what it kept came within 1 % of the least of these that anyone ended
with, and `held_out_relmse_…` where it ended.

Seconds are of tuning alone: scene, references, shaders and compiled functions are there before, for all. A
search may take SECONDS_OVER_OURS times as long as ours, so one that never arrives has about that as the
bound of its ratio. out/tuning/<scene>.json has what each search found and when; `python
scripts/tuning_table.py` prints it as a table.
"""

import contextlib
import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any, Literal

import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import REPOSITORY, present_scenes
from benchmarks.quality.open_formulas import babylon_irradiance, bgfx_irradiance
from benchmarks.tuning.tuning_objectives import (
    SPACE,
    SURROGATE_SPACE,
    CappedObjective,
    CountingRuntime,
    Point,
    RuntimeLoss,
    SearchIsOver,
    SurrogateLoss,
    Trace,
)
from benchmarks.tuning.tuning_searches import SEARCHES
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.strict_json import strict_json
from vpltune.renderer.frame.capture import CapturedFrame
from vpltune.tuner.evaluation.prepare_scene import SceneOptions, Stopwatch, prepare_scene
from vpltune.tuner.fitting.fit_density import (
    Rotation,
    fit_density,
    rotated_views,
    table_rotations,
    with_discs,
)
from vpltune.tuner.surrogate.captured_view import CapturedView

SIZE = (64, 48)
VPLS = 32
VIEWS = 2
HELD_OUT_ROTATIONS = 8
ROTATIONS = 4
"""Of the point table, for every view, the same for everyone: eight frames for a loss."""
RSM_RESOLUTION = 256
"""Everyone's. A finer one makes frames dearer, and with them the searches: the bound would be higher."""
SECONDS_OVER_OURS = 32.0
"""Seconds that a search may take, over ours."""
MOST_SECONDS = 120.0
"""And no more than these: where frames take long, the bound is lower."""
SURROGATE_CAP = 60
"""Evaluations of a search over the surrogate, at each placement."""
OWN_RUNS = 3
WITHIN = 0.01
SCENES = (
    "babylon-marble-tower",
    "bevy-cornellbox",
    "bevy-depthoffieldexample",
    "bevy-mixedlightingexample",
    "cornell-box",
    "courtyard",
    "cube2-steelribs",
    "gallery",
    "godot-living-room",
    "godot-zdm2",
    "kajiya-cornell-box",
    "nvpro-cornellbox",
    "playcanvas-chess-board",
    "playcanvas-house",
)
FOLDER = REPOSITORY / "out" / "tuning"


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """For every search, over the runtime and over the surrogate, its seconds over ours."""
    present = {name: path for name, path in present_scenes().items() if name in SCENES}
    measured = []
    for index, (name, path) in enumerate(present.items()):
        progress(f"tuning {name}", index / len(present))
        measured.append(measure_scene(name, path))
    progress("tuning", 1.0)
    return rows_of(measured)


def measure_scene(name: str, path: Path) -> dict[str, Any]:
    """Every search on one scene; written to out/tuning/<name>.json and returned."""
    problem = _problem(path)
    ours, placements = _ours(problem)
    traces = {"ours": ours}
    seconds = min(SECONDS_OVER_OURS * ours.spent_seconds, MOST_SECONDS)
    for search, run in SEARCHES.items():
        traces[search] = _searched(problem, run, seconds)
        traces[f"{search}_surrogate"] = _searched_on_surrogate(problem, run, placements, seconds)
    unseen = table_rotations(HELD_OUT_ROTATIONS, 0, held_out=True)
    held_out = RuntimeLoss(problem.runtime, problem.views, unseen, problem.base)
    losses = {
        "default": problem.loss(problem.start),
        "bgfx_formula": problem.loss.of_images(_formula(problem, bgfx_irradiance)),
        "babylon_formula": problem.loss.of_images(_formula(problem, babylon_irradiance)),
    }
    document = {
        "scene": name,
        "parameters": list(SPACE.names),
        "views": len(problem.views),
        "rotations": len(problem.rotations),
        "seconds_cap": seconds,
        "losses": losses,
        "default_held_out_relmse": held_out(problem.start),
        "searches": {key: _told(trace, held_out) for key, trace in traces.items()},
    }
    write_text_whole(FOLDER / f"{name}.json", strict_json(document) + "\n")
    return json.loads(strict_json(document))


@dataclass(frozen=True, eq=False)
class _Problem:
    runtime: CountingRuntime
    views: tuple[CapturedView, ...]
    rotations: tuple[Rotation, ...]
    base: ArtistParameters
    """Where everyone begins: the defaults, but few VPLs with cells."""
    loss: RuntimeLoss

    @property
    def start(self) -> Point:
        return SPACE.point(self.base)

    def captured(self, parameters: ArtistParameters) -> tuple[CapturedView, ...]:
        return rotated_views(self.runtime, self.views, parameters, self.rotations)


def _problem(path: Path) -> _Problem:
    base = with_discs(ArtistParameters(vpl_count=VPLS))
    config = TunedConfig(base, visibility="maps")
    options = SceneOptions(size=SIZE, views=VIEWS)
    prepared = prepare_scene(path, options, config, Stopwatch(), lambda stage, share: None)
    runtime = CountingRuntime(prepared.scene, config, rsm_resolution=RSM_RESOLUTION)
    views = tuple(view for view in prepared.views if view.view.split == "fitted")
    rotations = table_rotations(ROTATIONS, 0)
    return _Problem(runtime, views, rotations, base, RuntimeLoss(runtime, views, rotations, base))


def _ours(problem: _Problem) -> tuple[Trace, list[ArtistParameters]]:
    """The fit, the median of some runs after one that compiles; and the placements that it tried."""
    seconds = []
    for _ in range(1 + OWN_RUNS):
        problem.runtime.frames = 0
        started = time.perf_counter()
        fit = fit_density(
            problem.runtime, problem.views, problem.base, rotations=problem.rotations, robust=False
        )
        seconds.append(time.perf_counter() - started)
    trace, point, frames = Trace(), SPACE.point(fit.parameters), problem.runtime.frames
    trace.add(point, problem.loss(point), median(seconds[1:]), frames)
    placements = [
        replace(
            problem.base,
            density_exponent=trial.density_exponent,
            density_importance=trial.density_importance,
        )
        for trial in fit.trials
    ]
    return trace, placements


def _searched(problem: _Problem, run: Callable, seconds: float) -> Trace:
    problem.loss(problem.start)
    problem.runtime.frames = 0
    trace = Trace()
    with contextlib.suppress(SearchIsOver):
        run(
            CappedObjective(problem.loss, trace, lambda: problem.runtime.frames, seconds=seconds),
            problem.start,
        )
    return trace


def _searched_on_surrogate(
    problem: _Problem, run: Callable, placements: Sequence[ArtistParameters], seconds: float
) -> Trace:
    start = SURROGATE_SPACE.point(problem.base)
    SurrogateLoss(problem.captured(problem.base), problem.base)(start)
    problem.runtime.frames = 0
    trace, started = Trace(), time.perf_counter()
    for placement in placements:
        loss = SurrogateLoss(problem.captured(placement), placement)
        found = len(trace.points)
        objective = CappedObjective(
            loss, trace, lambda: problem.runtime.frames, SURROGATE_CAP, seconds=seconds, started=started
        )
        with contextlib.suppress(SearchIsOver):
            run(objective, start)
        where = SPACE.point(placement)[len(start) :]
        trace.points[found:] = [np.concatenate([point, where]) for point in trace.points[found:]]
    judged = Trace()
    for point, elapsed, frames in zip(trace.points, trace.seconds, trace.frames, strict=True):
        judged.add(point, problem.loss(point), elapsed, frames)
    judged.evaluations, judged.spent_seconds = trace.evaluations, trace.spent_seconds
    judged.spent_frames = trace.spent_frames
    return judged


def _formula(
    problem: _Problem, irradiance: Callable[[CapturedFrame], np.ndarray]
) -> Callable[[CapturedView, Rotation], np.ndarray]:
    captured = iter(problem.captured(problem.base))

    def image(view: CapturedView, rotation: Rotation) -> np.ndarray:
        frame = next(captured).captured
        drawn = np.zeros((*frame.valid.shape, 3), np.float32)
        drawn[frame.valid] = irradiance(frame)
        return drawn

    return image


def _told(trace: Trace, held_out: RuntimeLoss) -> dict[str, Any]:
    return {
        "evaluations": trace.evaluations,
        "spent_seconds": trace.spent_seconds,
        "spent_frames": trace.spent_frames,
        "seconds": trace.seconds,
        "frames": trace.frames,
        "losses": trace.losses,
        "held_out": [held_out(point) for point in trace.points],
        "point": trace.points[-1].tolist(),
    }


Judge = Literal["losses", "held_out"]
"""What a search minimised, or the same at rotations that it was not given."""


def best_found(scene: dict[str, Any], judge: Judge = "losses") -> float:
    """The least that anyone has ended with, by the runtime."""
    return min(search[judge][-1] for search in scene["searches"].values())


@dataclass(frozen=True)
class Spent:
    """Until a loss was reached; all that a search was given, where `there` is False."""

    seconds: float
    frames: int
    there: bool


def spent_to(search: dict[str, Any], aim: float, judge: Judge = "losses") -> Spent:
    """What a search spent until what it kept was at most `aim`."""
    for seconds, frames, value in zip(search["seconds"], search["frames"], search[judge], strict=True):
        if value <= aim:
            return Spent(seconds, frames, True)
    seconds = max(search["spent_seconds"], search["seconds"][-1])
    return Spent(seconds, max(search["spent_frames"], search["frames"][-1]), False)


def spent_in(scene: dict[str, Any], judge: Judge = "losses") -> dict[str, Spent]:
    """By search: what it spent to come within 1 % of the best."""
    best = best_found(scene, judge)
    aim = best + WITHIN * abs(best)
    return {name: spent_to(search, aim, judge) for name, search in scene["searches"].items()}


def rows_of(measured: list[dict[str, Any]]) -> list[Row]:
    """The rows of `vpltune bench tuning` from what was measured scene by scene."""
    result = []
    for judge, suffix in (("losses", ""), ("held_out", "_held_out")):
        spent = [spent_in(scene, judge) for scene in measured]
        soonest = [
            min((scene[name] for name in SEARCHES), key=lambda found: (not found.there, found.seconds))
            for scene in spent
        ]
        ours = [scene["ours"] for scene in spent]
        result.append(_spent_row(f"best_search{suffix}", soonest, ours, "seconds", "s"))
        result.append(_spent_row(f"best_search_frames{suffix}", soonest, ours, "frames", "frames"))
        for name in [f"{search}{form}" for form in ("", "_surrogate") for search in SEARCHES]:
            theirs = [scene[name] for scene in spent]
            result.append(_spent_row(f"{name}{suffix}", theirs, ours, "seconds", "s"))
    for name in ("default", "bgfx_formula", "babylon_formula"):
        over = median(scene["losses"][name] / best_found(scene) for scene in measured)
        result.append(Row(f"loss_{name}", over, "1", "best loss found by anyone", 1.0))
    for name in ("ours", *SEARCHES):
        over = median(scene["searches"][name]["losses"][-1] / best_found(scene) for scene in measured)
        result.append(Row(f"loss_{name}", over, "1", "best loss found by anyone", 1.0))
    unseen = "ours, at rotations that nobody was given"
    for name in SEARCHES:
        over = median(scene["searches"][name]["held_out"][-1] / _own_held_out(scene) for scene in measured)
        result.append(Row(f"held_out_relmse_{name}", over, "1", unseen, 1.0))
    over = median(scene["default_held_out_relmse"] / _own_held_out(scene) for scene in measured)
    result.append(Row("held_out_relmse_default", over, "1", unseen, 1.0))
    return result


def _own_held_out(scene: dict[str, Any]) -> float:
    return scene["searches"]["ours"]["held_out"][-1]


def _spent_row(name: str, theirs: list[Spent], ours: list[Spent], quantity: str, unit: str) -> Row:
    own = median(getattr(mine, quantity) for mine in ours)
    ratio = median(getattr(t, quantity) / getattr(o, quantity) for t, o in zip(theirs, ours, strict=True))
    against = f"ours ({sum(mine.there for mine in ours)} of {len(ours)} within 1 %)"
    missed = sum(not their.there for their in theirs)
    if missed:
        against += f"; ≥: {missed} of {len(theirs)} never got there"
    # Its median ratio, in our own median, so that the row's ratio is the median over scenes.
    return Row(name, ratio * own, unit, against, own)


if __name__ == "__main__":
    for each in sys.argv[1:]:
        measure_scene(each, present_scenes()[each])
