"""How long a fit takes to come within 1 % of the best loss that anyone finds, against searches of today.

Every search minimises the fit's own loss over all continuous parameters that are fitted, once by drawing
every view with the real runtime, reading it back and comparing it, and once with our surrogate in the
runtime's place. What a search finds on the surrogate is judged by the runtime. Seconds are of tuning alone:
scene, references, shaders and compiled functions are there before, for all. out/tuning/<scene>.json has what
each search found and when; `python scripts/tuning_table.py` prints it as a table.
"""

import contextlib
import json
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.open_formulas import babylon_irradiance, bgfx_irradiance
from benchmarks.row import Row
from benchmarks.scene_library import REPOSITORY, present_scenes
from benchmarks.tuning_objectives import CappedObjective, RuntimeLoss, SearchIsOver, Trace, surrogate_loss
from benchmarks.tuning_searches import SEARCHES
from renderer.artist_parameters import ArtistParameters
from renderer.atomic_file import write_text_whole
from renderer.capture import CapturedFrame
from renderer.runtime import Runtime
from renderer.strict_json import strict_json
from renderer.tuned_config import TunedConfig
from tuner.captured_view import CapturedView, capture_views
from tuner.fit_falloff import fit_to, fit_views
from tuner.fit_views import FitView
from tuner.prepare_scene import SceneOptions, Stopwatch, prepare_scene
from tuner.reduced_gather import ReducedGather, reduced_picture
from tuner.search_space import SearchSpace
from tuner.vpl_gather import FalloffParameters

SIZE = (64, 48)
VPLS = 256
FRAME_CAP = 300
"""Frames that a search over the runtime may draw in a scene."""
SURROGATE_CAP = 300
"""Evaluations of a search over the surrogate."""
OWN_RUNS = 5
SECONDS_CAP = 20.0
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
    traces = {"ours": _ours(problem)}
    for search, run in SEARCHES.items():
        traces[search] = _searched(problem, run)
        traces[f"{search}_surrogate"] = _searched_on_surrogate(problem, run)
    losses = {
        "default": problem.loss(problem.start),
        "bgfx_formula": problem.loss.of_pictures(_formula(bgfx_irradiance)),
        "babylon_formula": problem.loss.of_pictures(_formula(babylon_irradiance)),
    }
    document = {
        "scene": name,
        "parameters": list(SearchSpace().names),
        "views": len(problem.views),
        "losses": losses,
        "searches": {key: _told(trace) for key, trace in traces.items()},
    }
    write_text_whole(FOLDER / f"{name}.json", strict_json(document) + "\n")
    return json.loads(strict_json(document))


@dataclass(frozen=True, eq=False)
class _Problem:
    runtime: Runtime
    views: tuple[CapturedView, ...]
    base: ArtistParameters
    loss: RuntimeLoss

    @property
    def start(self) -> np.ndarray:
        return SearchSpace().point(self.base)


def _problem(path: Path) -> _Problem:
    base = ArtistParameters(vpl_count=VPLS)
    prepared = prepare_scene(
        path, SceneOptions(size=SIZE), TunedConfig(base), Stopwatch(), lambda stage, share: None
    )
    views = tuple(view for view in prepared.views if view.view.split == "fitted")
    return _Problem(prepared.runtime, views, base, RuntimeLoss(prepared.runtime, views, base))


def _captured(problem: _Problem) -> tuple[FitView, ...]:
    """Frames drawn anew and read back, and made ready for the surrogate: what ours has to pay."""
    problem.runtime.parameters = problem.base
    given = tuple(view.view for view in problem.views)
    captured = capture_views(problem.runtime, given, tuple(view.reference for view in problem.views))
    return fit_views(captured, problem.base)


def _ours(problem: _Problem) -> Trace:
    """Capture, binning and fit; the median of some runs after one that compiles."""
    seconds = []
    for _ in range(1 + OWN_RUNS):
        started = time.perf_counter()
        tuned, _ = fit_to(_captured(problem), problem.base)
        seconds.append(time.perf_counter() - started)
    trace = Trace()
    point = SearchSpace().point(tuned)
    trace.add(point, problem.loss(point), median(seconds[1:]), len(problem.views))
    return trace


def _searched(problem: _Problem, run: Callable) -> Trace:
    problem.loss(problem.start)
    problem.loss.frames = 0
    objective = CappedObjective(
        problem.loss,
        lambda: problem.loss.frames,
        time.perf_counter(),
        FRAME_CAP // len(problem.views),
        SECONDS_CAP,
    )
    return _run(run, objective, problem.start)


def _searched_on_surrogate(problem: _Problem, run: Callable) -> Trace:
    _squares(jnp.zeros(len(problem.start)), _captured(problem), problem.base)
    started = time.perf_counter()
    views = _captured(problem)
    offset = float(np.mean([view.reduced.offset for view in views]))
    loss = surrogate_loss(lambda point: _squares(point, views, problem.base), offset)
    frames = len(views)
    objective = CappedObjective(loss, lambda: frames, started, SURROGATE_CAP, SECONDS_CAP)
    trace = _run(run, objective, problem.start)
    trace.losses = [problem.loss(point) for point in trace.points]
    return trace


def _squares(point: jax.Array, views: tuple[FitView, ...], base: ArtistParameters) -> jax.Array:
    return _reduced_squares(
        jnp.asarray(point), tuple(view.reduced for view in views), FalloffParameters.of(base)
    )


@jax.jit
def _reduced_squares(
    point: jax.Array, reduced: tuple[ReducedGather, ...], rest: FalloffParameters
) -> jax.Array:
    parameters = replace(rest, **SearchSpace().values(point))
    return sum(jnp.sum((reduced_picture(view, parameters) - view.target) ** 2) for view in reduced) / len(
        reduced
    )


def _run(run: Callable, objective: CappedObjective, start: np.ndarray) -> Trace:
    with contextlib.suppress(SearchIsOver):
        run(objective, start)
    return objective.trace


def _formula(irradiance: Callable[[CapturedFrame], np.ndarray]) -> Callable[[CapturedView], np.ndarray]:
    def picture(view: CapturedView) -> np.ndarray:
        drawn = np.zeros((*view.captured.valid.shape, 3), np.float32)
        drawn[view.captured.valid] = irradiance(view.captured)
        return drawn

    return picture


def _told(trace: Trace) -> dict[str, Any]:
    return {
        "evaluations": trace.evaluations,
        "spent_seconds": trace.spent_seconds,
        "seconds": trace.seconds,
        "frames": trace.frames,
        "losses": trace.losses,
        "point": trace.points[int(np.argmin(trace.losses))].tolist(),
    }


def best_loss(scene: dict[str, Any]) -> float:
    """The least that anyone has found, by the runtime."""
    return min(min(search["losses"]) for search in scene["searches"].values())


def time_to(search: dict[str, Any], aim: float) -> tuple[float, bool]:
    """Seconds until a loss of at most `aim`; those it was given, and False, where it never got there."""
    for seconds, loss in zip(search["seconds"], search["losses"], strict=True):
        if loss <= aim:
            return seconds, True
    return max(search["spent_seconds"], search["seconds"][-1]), False


def rows_of(measured: list[dict[str, Any]]) -> list[Row]:
    """The rows of `vpltune bench tuning` from what was measured scene by scene."""
    aims = [best_loss(scene) + WITHIN * abs(best_loss(scene)) for scene in measured]
    ours = [time_to(scene["searches"]["ours"], aim) for scene, aim in zip(measured, aims, strict=True)]
    made = sum(there for _, there in ours)
    result = []
    for name in [f"{search}{form}" for form in ("", "_surrogate") for search in SEARCHES]:
        times = [time_to(scene["searches"][name], aim) for scene, aim in zip(measured, aims, strict=True)]
        ratios = [theirs / mine for (theirs, _), (mine, _) in zip(times, ours, strict=True)]
        seconds = [mine for mine, _ in ours]
        # Its median ratio, in seconds of our own median, so that the row's ratio is the median over scenes.
        missed = sum(not there for _, there in times)
        against = f"ours ({made} of {len(ours)} within 1 %)"
        if missed:
            against += f"; ≥: {missed} of {len(times)} never got there"
        result.append(Row(name, median(ratios) * median(seconds), "s", against, median(seconds)))
    for name in ("default", "bgfx_formula", "babylon_formula"):
        over = median(scene["losses"][name] / best_loss(scene) for scene in measured)
        result.append(Row(f"loss_{name}", over, "1", "best loss found by anyone", 1.0))
    result.append(
        Row(
            "loss_ours",
            median(min(scene["searches"]["ours"]["losses"]) / best_loss(scene) for scene in measured),
            "1",
            "best loss found by anyone",
            1.0,
        )
    )
    return result
