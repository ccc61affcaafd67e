"""How long a fit and other searches take until they are within 1 % of the best loss that any of them finds.

**The problem.** All seven continuous parameters are free: k, α, κ, β, σ, γ and η. The VPLs are few, clustered
disc lights with visibility maps. The loss is relMSE, the mean over views and `ROTATIONS` rotations of the
point table. A search evaluates it by drawing every view with the runtime, reading the images back, and
comparing them. Our fit is `tuner.fitting.fit_density` on the same views and rotations. It minimises relMSE
here too, and not its robust error.

**Searches on the surrogate.** The surrogate cannot place VPLs, so it serves for the first five parameters
only. A search with the suffix `_surrogate` takes the placements that our fit tried, in the same order, and
searches the five at each placement. The runtime evaluates the points that it finds. The difference to our fit
is what least squares are worth; the rest of the gain is the surrogate's.

**Held-out rotations.** With few rotations, a search that tries many placements ends at one that happens to
suit the point table. Every point that a search kept is therefore also evaluated at rotations that no search
was given. The rows `…_held_out` tell when a search's points came within 1 % of the least loss at these
rotations, and `held_out_relmse_…` tells the loss at its end.

**Time.** Seconds count the search alone: scene, references, shaders and compiled functions exist before it
starts. A search may take `SECONDS_OVER_OURS` times as long as our fit, so the ratio of one that never arrives
is bounded by about that. out/tuning/<scene>.json holds what each search found and when, and `python
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
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
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
)
from vpltune.tuner.surrogate.captured_view import CapturedView

SIZE = (64, 48)
"""Width and height of a view in pixels: those of a fit."""
VPLS = 32
"""VPLs of every image. A choice."""
VIEWS = 2
"""Fitted views. A choice."""
HELD_OUT_ROTATIONS = 8
"""Rotations of the point table that no search is given. A choice."""
ROTATIONS = 4
"""Rotations of the point table that all searches are given: eight frames for a loss. A choice."""
RSM_RESOLUTION = 256
"""Texels along the side of an RSM face. A choice: a finer RSM makes every frame slower, and all searches
with it."""
SECONDS_OVER_OURS = 32.0
"""Most seconds of a search over those of our fit. A choice."""
MOST_SECONDS = 120.0
"""Most seconds of a search, which lower the bound where frames take long. A choice."""
SURROGATE_CAP = 60
"""Evaluations of a search on the surrogate, at each placement. A choice."""
OWN_RUNS = 3
"""Timed runs of our fit, of which the median counts. A choice."""
WITHIN = 0.01
"""Relative distance to the best loss at which a search has arrived. A choice."""
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
"""The folder with a JSON file for each measured scene."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """For every search, on the runtime and on the surrogate, its seconds, frames and losses against ours."""
    present = {name: path for name, path in present_scenes().items() if name in SCENES}
    measured = []
    for index, (name, path) in enumerate(present.items()):
        progress(f"tuning {name}", index / len(present))
        measured.append(measure_scene(name, path))
    progress("tuning", 1.0)
    return rows_of(measured)


def measure_scene(name: str, path: Path) -> dict[str, Any]:
    """Run our fit and every search on one scene; writes out/tuning/<name>.json, and returns its content."""
    problem = _problem(path)
    ours, placements = _ours(problem)
    traces = {"ours": ours}
    seconds = min(SECONDS_OVER_OURS * ours.spent_seconds, MOST_SECONDS)
    for search, run in SEARCHES.items():
        traces[search] = _searched(problem, run, seconds)
        traces[f"{search}_surrogate"] = _searched_on_surrogate(problem, run, placements, seconds)
    unseen = table_rotations(HELD_OUT_ROTATIONS, 0, held_out=True)
    held_out = RuntimeLoss(problem.runtime, problem.views, unseen, problem.config)
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
    """What all searches are given for one scene."""

    runtime: CountingRuntime
    views: tuple[CapturedView, ...]
    rotations: tuple[Rotation, ...]
    config: TunedConfig
    """The start of every search: the defaults with few VPLs, which are clustered disc lights."""
    loss: RuntimeLoss

    @property
    def base(self) -> ArtistParameters:
        """The parameters that every search starts with."""
        return self.config.parameters

    @property
    def start(self) -> Point:
        """The start as a point of the unit cube."""
        return SPACE.point(self.base)

    def captured(self, parameters: ArtistParameters) -> tuple[CapturedView, ...]:
        """The views drawn with `parameters` at every rotation."""
        config = self.config.with_parameters(parameters)
        return rotated_views(self.runtime, self.views, config, self.rotations)


def _problem(path: Path) -> _Problem:
    base = ArtistParameters(vpl_count=VPLS)
    config = TunedConfig(base, quality=Quality(rsm_resolution=RSM_RESOLUTION), light=ONE_BOUNCE)
    options = SceneOptions(size=SIZE, views=VIEWS)
    prepared = prepare_scene(path, options, config, Stopwatch(), lambda stage, share: None)
    runtime = CountingRuntime(prepared.scene, context=prepared.runtime.context)
    views = tuple(view for view in prepared.views if view.view.split == "fitted")
    rotations = table_rotations(ROTATIONS, 0)
    return _Problem(runtime, views, rotations, config, RuntimeLoss(runtime, views, rotations, config))


def _ours(problem: _Problem) -> tuple[Trace, list[ArtistParameters]]:
    """Run our fit, and return its trace and the placements that it tried.

    Its seconds are the median of some runs, after one that compiles.
    """
    seconds = []
    for _ in range(1 + OWN_RUNS):
        problem.runtime.frames = 0
        started = time.perf_counter()
        fit = fit_density(
            problem.runtime, problem.views, problem.config, rotations=problem.rotations, robust=False
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
    """Run a search on the runtime for at most `seconds`."""
    # Compiles the shaders.
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
    """Run a search on the surrogate at each placement, for at most `seconds` in all."""
    start = SURROGATE_SPACE.point(problem.base)
    # Compiles the loss.
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
    # The runtime judges the points that were found.
    judged = Trace()
    for point, elapsed, frames in zip(trace.points, trace.seconds, trace.frames, strict=True):
        judged.add(point, problem.loss(point), elapsed, frames)
    judged.evaluations, judged.spent_seconds = trace.evaluations, trace.spent_seconds
    judged.spent_frames = trace.spent_frames
    return judged


def _formula(
    problem: _Problem, irradiance: Callable[[CapturedFrame], np.ndarray]
) -> Callable[[CapturedView, Rotation], np.ndarray]:
    """A function that draws with one of `open_formulas`; it must be called for views and rotations in
    order."""
    captured = iter(problem.captured(problem.base))

    def image(view: CapturedView, rotation: Rotation) -> np.ndarray:
        frame = next(captured).captured
        drawn = np.zeros((*frame.valid.shape, 3), np.float32)
        drawn[frame.valid] = irradiance(frame)
        return drawn

    return image


def _told(trace: Trace, held_out: RuntimeLoss) -> dict[str, Any]:
    """The part of the JSON file about one search."""
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
"""The rotations of a loss: those that searches were given, or the held-out ones."""


def best_found(scene: dict[str, Any], judge: Judge = "losses") -> float:
    """The least loss that any search ended with, by the runtime."""
    return min(search[judge][-1] for search in scene["searches"].values())


@dataclass(frozen=True)
class Spent:
    """The seconds and frames of a search until it reached a loss."""

    seconds: float
    frames: int
    arrived: bool
    """Whether it did; else the figures are all that it spent."""


def spent_to(search: dict[str, Any], aim: float, judge: Judge = "losses") -> Spent:
    """What a search spent until the loss of a point that it kept was at most `aim`."""
    for seconds, frames, value in zip(search["seconds"], search["frames"], search[judge], strict=True):
        if value <= aim:
            return Spent(seconds, frames, True)
    seconds = max(search["spent_seconds"], search["seconds"][-1])
    return Spent(seconds, max(search["spent_frames"], search["frames"][-1]), False)


def spent_in(scene: dict[str, Any], judge: Judge = "losses") -> dict[str, Spent]:
    """What each search spent to come within 1 % of the best loss, by its name."""
    best = best_found(scene, judge)
    aim = best + WITHIN * abs(best)
    return {name: spent_to(search, aim, judge) for name, search in scene["searches"].items()}


def rows_of(measured: list[dict[str, Any]]) -> list[Row]:
    """The rows of the benchmark, from the contents of the JSON files of all scenes."""
    result = []
    judges: tuple[tuple[Judge, str], ...] = (("losses", ""), ("held_out", "_held_out"))
    for judge, suffix in judges:
        spent = [spent_in(scene, judge) for scene in measured]
        soonest = [
            min((scene[name] for name in SEARCHES), key=lambda found: (not found.arrived, found.seconds))
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
        result.append(Row(f"loss_{name}", over, "1", "best loss of any search", 1.0))
    for name in ("ours", *SEARCHES):
        over = median(scene["searches"][name]["losses"][-1] / best_found(scene) for scene in measured)
        result.append(Row(f"loss_{name}", over, "1", "best loss of any search", 1.0))
    unseen = "ours, at held-out rotations"
    for name in SEARCHES:
        over = median(scene["searches"][name]["held_out"][-1] / _own_held_out(scene) for scene in measured)
        result.append(Row(f"held_out_relmse_{name}", over, "1", unseen, 1.0))
    over = median(scene["default_held_out_relmse"] / _own_held_out(scene) for scene in measured)
    result.append(Row("held_out_relmse_default", over, "1", unseen, 1.0))
    return result


def _own_held_out(scene: dict[str, Any]) -> float:
    """The loss of our fit at held-out rotations."""
    return scene["searches"]["ours"]["held_out"][-1]


def _spent_row(name: str, theirs: list[Spent], ours: list[Spent], quantity: str, unit: str) -> Row:
    """A search's seconds or frames to come within 1 % of the best, against ours.

    The row's ratio is the median over scenes of the ratio: its value is that median times our own median.
    """
    own = median(getattr(mine, quantity) for mine in ours)
    ratio = median(getattr(t, quantity) / getattr(o, quantity) for t, o in zip(theirs, ours, strict=True))
    against = f"ours ({sum(mine.arrived for mine in ours)} of {len(ours)} within 1 %)"
    missed = sum(not their.arrived for their in theirs)
    if missed:
        against += f"; a lower bound: {missed} of {len(theirs)} were stopped before"
    return Row(name, ratio * own, unit, against, own)


if __name__ == "__main__":
    for each in sys.argv[1:]:
        measure_scene(each, present_scenes()[each])
