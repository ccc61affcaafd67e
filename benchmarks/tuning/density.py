"""Error against the number of VPLs, on rotations not fitted to: uniform, default, cells and fitted.

With visibility maps, on fitted and held-out views. γ, η and the maps' parameters are fitted once for each
scene, at `FITTED_COUNT` VPLs, the falloff at every count. Curves go to out/density/curves.{json,png}.

`python -m benchmarks.tuning.density SCENE …` does it for some of the scenes only.
"""

import json
import statistics
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import REPOSITORY, present_scenes
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.atomic_file import write_text_whole, written_whole
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.views import View
from vpltune.tuner.evaluation.prepare_scene import PreparedScene, SceneOptions, Stopwatch, prepare_scene
from vpltune.tuner.fitting.fit_density import (
    LLOYD_ITERATIONS,
    fit_density,
    rotated_views,
    rotation_errors,
    table_rotations,
    with_discs,
)
from vpltune.tuner.fitting.fit_placement import PlacementFit, fit_placement
from vpltune.tuner.surrogate.captured_view import CapturedView

SCENES = (
    "cornell-box",
    "courtyard",
    "gallery",
    "bevy-cornellbox",
    "godot-living-room",
    "kajiya-cornell-box",
    "godot-zdm2",
    "nvpro-cornellbox",
)
SIZE = (64, 48)
COUNTS = (8, 16, 32, 64, 128, 256, 512, 1024)
FITTED_COUNT = 32
DEFAULT_COUNT = 256
INTERLEAVES = (2, 4)
ROTATIONS = 4
"""To fit to, and as many others to measure on."""
COST_SIZE = (640, 360)
COST_TURNS = 3
COST_PASSES = (
    "vpl_importance",
    "virtual_point_lights",
    "clustered_discs",
    "vpl_visibility_maps",
    "vpl_gather",
    "interleaved_filter",
)
SLOPE_STEPS = 20
"""Along η, at each of which the sign of the measured slope is compared with the smooth trend's."""
LLOYD_ITERATIONS_TRIED = (1, 4, 16)
"""Steps to measure beside those that fits take."""
_UNFITTED = {
    "uniform": ArtistParameters(density_exponent=0.0),
    "default": ArtistParameters(),
    "cells": with_discs(ArtistParameters()),
}
VARIANTS = (*_UNFITTED, "fitted")

Curve = dict[int, float]
Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class SceneCurves:
    """relMSE by VPL count, means over all views and held-out rotations."""

    name: str
    uniform: Curve
    default: Curve
    cells: Curve
    """The default's, but for the cells."""
    fitted: Curve
    interleaved: Curve
    """Fitted, by side of the block: FITTED_COUNT VPLs for each pixel, side² times as many in all."""
    parameters: ArtistParameters
    """Fitted at FITTED_COUNT."""


def rows(progress: Progress) -> list[Row]:
    """For each scene and in the median: VPLs for the same error, and few tuned ones against many."""
    present = present_scenes()
    names = [name for name in SCENES if name in present]
    curves = [measured_curves(name, present[name], progress) for name in names]
    write_curves(REPOSITORY / "out" / "density", curves)
    made = [*curve_rows(curves), *cost_rows(present[names[0]], progress)]
    made += relaxation_rows(names, present, progress)
    return [*made, slope_row(names[0], present[names[0]], progress)]


def curve_rows(curves: Sequence[SceneCurves]) -> list[Row]:
    """Of scenes that were measured."""
    made = []
    for scene in curves:
        same = count_for_error(scene.uniform, scene.fitted[FITTED_COUNT])
        made += [
            Row(
                f"vpls_for_same_error.{scene.name}", float(FITTED_COUNT), "VPLs", "uniform over texels", same
            ),
            Row(
                f"tuned_vpls_for_default_256.{scene.name}",
                count_for_error(scene.fitted, scene.default[DEFAULT_COUNT]),
                "VPLs",
                "default",
                float(DEFAULT_COUNT),
            ),
            Row(
                f"tuned_32_over_discs_256.{scene.name}",
                scene.fitted[FITTED_COUNT],
                "relMSE",
                f"default but for its cells at {DEFAULT_COUNT} VPLs",
                scene.cells[DEFAULT_COUNT],
            ),
            Row(
                f"tuned_32_over_default_256.{scene.name}",
                scene.fitted[FITTED_COUNT],
                "relMSE",
                f"default at {DEFAULT_COUNT} VPLs",
                scene.default[DEFAULT_COUNT],
            ),
            Row(
                f"tuned_32_over_default_32.{scene.name}",
                scene.fitted[FITTED_COUNT],
                "relMSE",
                "default at as many VPLs",
                scene.default[FITTED_COUNT],
            ),
        ]
        made += [
            Row(
                f"tuned_32_a_pixel_{side}x{side}_over_default_256.{scene.name}",
                error,
                "relMSE",
                f"default at {DEFAULT_COUNT} VPLs a pixel",
                scene.default[DEFAULT_COUNT],
            )
            for side, error in scene.interleaved.items()
        ]
    for name in dict.fromkeys(row.name.split(".")[0] for row in made):
        ratios = [row.ratio for row in made if row.name.startswith(f"{name}.")]
        made.append(Row(name, statistics.median(ratios), "1", "median over scenes; limit", 1.0))
    return made


def measured_curves(name: str, path: Path, progress: Progress) -> SceneCurves:
    """All curves of one scene."""
    prepared = _prepared(path)
    runtime, views = prepared.runtime, prepared.views
    fitted_views = [view for view in views if view.view.split == "fitted"]
    rotations = table_rotations(ROTATIONS, 0)
    progress(f"{name}: density", 0.0)
    start = ArtistParameters(vpl_count=FITTED_COUNT)
    found = fit_density(runtime, fitted_views, start, rotations=rotations).parameters
    curves: dict[str, Curve] = {variant: {} for variant in VARIANTS}
    fits: dict[int, ArtistParameters] = {}
    for index, count in enumerate(COUNTS):
        progress(f"{name}: {count} VPLs", index / len(COUNTS))
        drawn = replace(found, vpl_count=count)
        tuned = _fit(rotated_views(runtime, fitted_views, drawn, rotations), drawn).parameters
        fits[count] = tuned
        for variant, parameters in (*_UNFITTED.items(), ("fitted", tuned)):
            curves[variant][count] = _error(runtime, views, replace(parameters, vpl_count=count))
    curves["interleaved"] = {
        side: _interleaved_error(prepared, fits[FITTED_COUNT * side**2], side) for side in INTERLEAVES
    }
    return SceneCurves(name, **curves, parameters=found)


def cost_rows(path: Path, progress: Progress) -> list[Row]:
    """What VPLs cost from placement to image, frames drawn in turn: with cells, against the default.

    The rows `tuned_32_a_pixel_…` are to be read beside these.
    """
    scene = read_scene(path)
    camera, lights, _ = resolve_camera_and_lights(scene, path, None, None)
    view = View("cost", "fitted", COST_SIZE, camera, lights)
    cells = with_discs(ArtistParameters())
    drawn = {
        "32": (replace(cells, vpl_count=FITTED_COUNT), 1),
        **{f"32_a_pixel_{s}x{s}": (replace(cells, vpl_count=FITTED_COUNT * s**2), s) for s in INTERLEAVES},
        "default": (ArtistParameters(vpl_count=DEFAULT_COUNT), 1),
    }
    best = dict.fromkeys(drawn, np.inf)
    with create_context() as context:
        runtimes = {
            name: Runtime(
                scene,
                TunedConfig(parameters, visibility="maps"),
                RuntimeOptions(interleave=side),
                context=context,
            )
            for name, (parameters, side) in drawn.items()
        }
        for turn in range(COST_TURNS):
            progress("cost", turn / COST_TURNS)
            for name, runtime in runtimes.items():
                passes = runtime.pass_milliseconds(view, 1)
                best[name] = min(best[name], sum(passes.get(each, 0.0) for each in COST_PASSES))
    against = f"default at {DEFAULT_COUNT} VPLs, {COST_SIZE[0]}x{COST_SIZE[1]}"
    default = best.pop("default")
    return [Row(f"cost_{name}", taken, "ms", against, default) for name, taken in best.items()]


def relaxation_rows(names: Sequence[str], present: Mapping[str, Path], progress: Progress) -> list[Row]:
    """Unfitted cells after more and fewer steps, in the geometric mean over scenes."""
    logs: dict[int, list[float]] = {steps: [] for steps in (LLOYD_ITERATIONS, *LLOYD_ITERATIONS_TRIED)}
    for name in names:
        progress(f"{name}: relaxation", 0.0)
        prepared = _prepared(present[name])
        for steps, found in logs.items():
            cells = replace(with_discs(ArtistParameters(vpl_count=FITTED_COUNT)), lloyd_iterations=steps)
            found.append(np.log(_error(prepared.runtime, prepared.views, cells)))
    error = {steps: float(np.exp(np.mean(found))) for steps, found in logs.items()}
    against = f"after {LLOYD_ITERATIONS} steps, {FITTED_COUNT} cells"
    return [
        Row(f"relaxation_{steps}", error[steps], "relMSE", against, error[LLOYD_ITERATIONS])
        for steps in LLOYD_ITERATIONS_TRIED
    ]


def count_for_error(curve: Curve, error: float) -> float:
    """How many VPLs the curve needs for that error; its last count where it does not get there."""
    counts, errors = np.log(list(curve)), np.log(np.maximum(list(curve.values()), 1e-9))
    # Counts that noise has made worse than fewer are passed over: the curve falls all the way.
    first = errors < np.minimum.accumulate(np.concatenate([[np.inf], errors[:-1]]))
    return float(np.exp(np.interp(-np.log(max(error, 1e-9)), -errors[first], counts[first])))


def slope_row(name: str, path: Path, progress: Progress) -> Row:
    """How often a step along η tells the way that the smooth trend of the same losses goes.

    A gradient is of use where it does nearly always; a coin would do so half of the time.
    """
    prepared = _prepared(path)
    runtime, views = prepared.runtime, prepared.views
    fitted_views = [view for view in views if view.view.split == "fitted"]
    rotations, places = table_rotations(ROTATIONS, 0), np.linspace(0.0, 1.0, SLOPE_STEPS + 1)
    losses = []
    for index, importance in enumerate(places):
        progress(f"{name}: slopes", index / len(places))
        candidate = ArtistParameters(vpl_count=FITTED_COUNT, density_importance=float(importance))
        losses.append(
            _fit(rotated_views(runtime, fitted_views, candidate, rotations), candidate).descent.loss
        )
    trend = np.polynomial.Polynomial.fit(places, losses, 2)
    agree = np.mean(np.sign(np.diff(losses)) == np.sign(np.diff(trend(places))))
    return Row("density_slope_agreement", float(agree), "share of steps", "a coin", 0.5)


def write_curves(folder: Path, curves: Sequence[SceneCurves]) -> None:
    """curves.json, and curves.png with a panel for each scene."""
    # Here: matplotlib takes half a second to load.
    from matplotlib.figure import Figure

    document = {
        scene.name: {
            **{variant: getattr(scene, variant) for variant in VARIANTS},
            "interleaved": scene.interleaved,
            "parameters": scene.parameters.as_dict(),
        }
        for scene in curves
    }
    write_text_whole(folder / "curves.json", json.dumps(document, indent=1) + "\n")
    columns = min(3, len(curves))
    lines = -(-len(curves) // columns)
    figure = Figure(figsize=(4.0 * columns, 3.2 * lines), layout="constrained")
    panels = figure.subplots(lines, columns, squeeze=False).ravel()
    for axes, scene in zip(panels, curves, strict=False):
        for label in VARIANTS:
            curve = getattr(scene, label)
            axes.loglog(list(curve), list(curve.values()), "o-", markersize=3, label=label)
        axes.set(title=scene.name, xlabel="VPLs", ylabel="relMSE")
        axes.grid(which="both", alpha=0.2)
        axes.legend()
    with written_whole(folder / "curves.png") as temporary:
        figure.savefig(temporary, dpi=100)


def _prepared(path: Path) -> PreparedScene:
    config = TunedConfig(ArtistParameters(vpl_count=FITTED_COUNT), visibility="maps")
    return prepare_scene(path, SceneOptions(size=SIZE), config, Stopwatch(), lambda stage, share: None)


def _error(runtime: Runtime, views: Sequence[CapturedView], parameters: ArtistParameters) -> float:
    rotations = table_rotations(ROTATIONS, 0, held_out=True)
    return float(rotation_errors(runtime, views, parameters, rotations).mean())


def _interleaved_error(prepared: PreparedScene, parameters: ArtistParameters, side: int) -> float:
    runtime = prepared.runtime
    config, options = TunedConfig(parameters, visibility=runtime.visibility), RuntimeOptions(interleave=side)
    interleaved = Runtime(prepared.scene, config, options, context=runtime.context)
    return _error(interleaved, prepared.views, parameters)


def _main(names: Sequence[str]) -> None:
    def progress(stage: str, share: float) -> None:
        print(f"{stage} {share:.0%}", file=sys.stderr)

    curves = [measured_curves(name, present_scenes()[name], progress) for name in names]
    write_curves(REPOSITORY / "out" / "density" / "-".join(names), curves)
    for row in (*curve_rows(curves), *relaxation_rows(names, present_scenes(), progress)):
        print(f"{row.name:45s} {row.value:10.4g} {row.against_value:10.4g} {row.ratio:8.3f}  {row.against}")


def _fit(views: Sequence[CapturedView], start: ArtistParameters) -> PlacementFit:
    """The least relMSE: one measure for all densities and counts."""
    return fit_placement(views, start)


if __name__ == "__main__":
    _main(sys.argv[1:])
