"""Error against VPL count, on held-out rotations of the point table: uniform, default, discs and fitted.

All images have visibility maps, and errors are means over fitted and held-out views. γ, η and the maps'
parameters are fitted once for each scene, at `FITTED_COUNT` VPLs; the falloff is fitted at every count. The
curves are written to out/density/curves.json and curves.png. The default is that of version 0.1: points.

`python -m benchmarks.tuning.density SCENE …` measures only the scenes that are named.
"""

import json
import statistics
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import REPOSITORY, present_scenes, scene_and_view
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.atomic_file import write_text_whole, written_whole
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.gpu_context import create_context
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
"""Width and height of a view in pixels: those of a fit."""
COUNTS = (8, 16, 32, 64, 128, 256, 512, 1024)
"""VPL counts of the curves. A choice."""
FITTED_COUNT = 32
"""VPLs at which γ, η and the maps' parameters are fitted. A choice."""
DEFAULT_COUNT = 256
"""VPLs of the default image that few fitted VPLs are compared with. A choice."""
INTERLEAVES = (2, 4)
"""Sides of interleaved blocks to compare. A choice."""
ROTATIONS = 4
"""Rotations that are fitted to, and held-out ones that errors are measured on. A choice."""
COST_SIZE = (640, 360)
"""Width and height of the timed image in pixels. A choice: a ninth of 1080p, for software renderers."""
COST_TURNS = 3
"""Timed frames, of which the fastest counts. A choice."""
COST_PASSES = (
    "vpl_importance",
    "virtual_point_lights",
    "clustered_discs",
    "vpl_visibility_maps",
    "vpl_gather",
    "interleaved_filter",
)
SLOPE_STEPS = 20
"""Steps along η, at each of which the slope's sign is compared with that of the smooth trend. A choice."""
LLOYD_ITERATIONS_TRIED = (1, 4, 16)
"""Lloyd iterations to compare with those of a fit. A choice."""
LEAST_ERROR = 1e-9
"""Errors below this count as this much, so that their logarithms are finite."""
_OLD = ArtistParameters(falloff_footprint=0.5, density_importance=0.0, lloyd_iterations=0)
"""The default of version 0.1: points."""
_UNFITTED = {"uniform": replace(_OLD, density_exponent=0.0), "default": _OLD, "discs": with_discs(_OLD)}
VARIANTS = (*_UNFITTED, "fitted")

Curve = dict[int, float]
"""relMSE by VPL count."""
Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class SceneCurves:
    """The curves of one scene, means over all views and held-out rotations."""

    name: str
    uniform: Curve
    """The default, with VPLs uniform over RSM texels."""
    default: Curve
    discs: Curve
    """The default, with clustered disc lights."""
    fitted: Curve
    interleaved: Curve
    """relMSE of the fitted parameters by side of the interleaved block. Each pixel gathers FITTED_COUNT VPLs,
    of side² times as many in all."""
    parameters: ArtistParameters
    """The parameters that were fitted at FITTED_COUNT VPLs."""


def rows(progress: Progress) -> list[Row]:
    """For each scene and in the median, the VPLs for equal error, and few fitted VPLs against many; then
    costs."""
    present = present_scenes()
    names = [name for name in SCENES if name in present]
    curves = [measured_curves(name, present[name], progress) for name in names]
    write_curves(REPOSITORY / "out" / "density", curves)
    made = [*curve_rows(curves), *cost_rows(present[names[0]], progress)]
    made += relaxation_rows(names, present, progress)
    return [*made, slope_row(names[0], present[names[0]], progress)]


def curve_rows(curves: Sequence[SceneCurves]) -> list[Row]:
    """The rows about error, from the curves of all scenes."""
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
                f"default with {DEFAULT_COUNT} clustered discs",
                scene.discs[DEFAULT_COUNT],
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
                f"default at {FITTED_COUNT} VPLs",
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
    """Fit one scene, and measure all its curves."""
    prepared = _prepared(path)
    runtime, views = prepared.runtime, prepared.views
    fitted_views = [view for view in views if view.view.split == "fitted"]
    rotations = table_rotations(ROTATIONS, 0)
    progress(f"{name}: density", 0.0)
    start = TunedConfig(ArtistParameters(vpl_count=FITTED_COUNT), light=ONE_BOUNCE)
    found = fit_density(runtime, fitted_views, start, rotations=rotations).parameters
    curves: dict[str, Curve] = {variant: {} for variant in VARIANTS}
    fits: dict[int, ArtistParameters] = {}
    for index, count in enumerate(COUNTS):
        progress(f"{name}: {count} VPLs", index / len(COUNTS))
        drawn = TunedConfig(replace(found, vpl_count=count), light=ONE_BOUNCE)
        rotated = rotated_views(runtime, fitted_views, drawn, rotations)
        tuned = _fit(rotated, drawn.parameters).parameters
        fits[count] = tuned
        for variant, parameters in (*_UNFITTED.items(), ("fitted", tuned)):
            config = TunedConfig(replace(parameters, vpl_count=count), light=ONE_BOUNCE)
            curves[variant][count] = _error(runtime, views, config)
    curves["interleaved"] = {
        side: _error(runtime, views, _interleaved(fits[FITTED_COUNT * side**2], side)) for side in INTERLEAVES
    }
    return SceneCurves(name, **curves, parameters=found)


def cost_rows(path: Path, progress: Progress) -> list[Row]:
    """Milliseconds of all passes that VPLs pay for: few clustered discs against the default.

    The costs `cost_32_a_pixel_…` belong to the errors `tuned_32_a_pixel_…`. Frames are drawn in turns, so
    that other load on the machine slows all of them alike.
    """
    scene, view = scene_and_view(path, COST_SIZE)
    discs = with_discs(_OLD)
    configs = {
        "32": _interleaved(replace(discs, vpl_count=FITTED_COUNT), 1),
        **{
            f"32_a_pixel_{side}x{side}": _interleaved(replace(discs, vpl_count=FITTED_COUNT * side**2), side)
            for side in INTERLEAVES
        },
        "default": _interleaved(replace(_OLD, vpl_count=DEFAULT_COUNT), 1),
    }
    best = dict.fromkeys(configs, np.inf)
    with create_context() as context:
        runtime = Runtime(scene, context=context)
        for turn in range(COST_TURNS):
            progress("cost", turn / COST_TURNS)
            for name, config in configs.items():
                passes = runtime.pass_milliseconds(view, config, 1)
                best[name] = min(best[name], sum(passes.get(each, 0.0) for each in COST_PASSES))
    against = f"default at {DEFAULT_COUNT} VPLs, {COST_SIZE[0]}x{COST_SIZE[1]}"
    default = best.pop("default")
    return [Row(f"cost_{name}", taken, "ms", against, default) for name, taken in best.items()]


def relaxation_rows(names: Sequence[str], present: Mapping[str, Path], progress: Progress) -> list[Row]:
    """relMSE after fewer and more Lloyd iterations, with unfitted discs: geometric means over scenes."""
    discs = with_discs(replace(_OLD, vpl_count=FITTED_COUNT))
    logs: dict[int, list[float]] = {count: [] for count in (LLOYD_ITERATIONS, *LLOYD_ITERATIONS_TRIED)}
    for name in names:
        progress(f"{name}: Lloyd iterations", 0.0)
        prepared = _prepared(present[name])
        for count, found in logs.items():
            config = TunedConfig(replace(discs, lloyd_iterations=count), light=ONE_BOUNCE)
            found.append(np.log(_error(prepared.runtime, prepared.views, config)))
    error = {count: float(np.exp(np.mean(found))) for count, found in logs.items()}
    against = f"{LLOYD_ITERATIONS} Lloyd iterations, {FITTED_COUNT} discs"
    return [
        Row(f"relaxation_{count}", error[count], "relMSE", against, error[LLOYD_ITERATIONS])
        for count in LLOYD_ITERATIONS_TRIED
    ]


def count_for_error(curve: Curve, error: float) -> float:
    """The VPL count at which the curve has that error, or its last count if it never does."""
    counts, errors = np.log(list(curve)), np.log(np.maximum(list(curve.values()), LEAST_ERROR))
    # Skips counts whose error is above that of a smaller count, which is noise: the rest falls all the way.
    first = errors < np.minimum.accumulate(np.concatenate([[np.inf], errors[:-1]]))
    return float(np.exp(np.interp(-np.log(max(error, LEAST_ERROR)), -errors[first], counts[first])))


def slope_row(name: str, path: Path, progress: Progress) -> Row:
    """The share of steps along η whose loss changes in the direction of a smooth trend through all losses.

    Gradient descent over η needs a share close to 1. A coin has 0.5.
    """
    prepared = _prepared(path)
    runtime, views = prepared.runtime, prepared.views
    fitted_views = [view for view in views if view.view.split == "fitted"]
    rotations, places = table_rotations(ROTATIONS, 0), np.linspace(0.0, 1.0, SLOPE_STEPS + 1)
    losses = []
    for index, importance in enumerate(places):
        progress(f"{name}: slopes", index / len(places))
        start = replace(_OLD, vpl_count=FITTED_COUNT, density_importance=float(importance))
        rotated = rotated_views(runtime, fitted_views, TunedConfig(start, light=ONE_BOUNCE), rotations)
        losses.append(_fit(rotated, start).descent.loss)
    trend = np.polynomial.Polynomial.fit(places, losses, 2)
    agree = np.mean(np.sign(np.diff(losses)) == np.sign(np.diff(trend(places))))
    return Row("density_slope_agreement", float(agree), "share of steps", "a coin", 0.5)


def write_curves(folder: Path, curves: Sequence[SceneCurves]) -> None:
    """Write curves.json, and curves.png with a panel for each scene, into `folder`."""
    # Imported here because matplotlib takes half a second to load.
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
    config = TunedConfig(ArtistParameters(vpl_count=FITTED_COUNT), light=ONE_BOUNCE)
    return prepare_scene(path, SceneOptions(size=SIZE), config, Stopwatch(), lambda stage, share: None)


def _interleaved(parameters: ArtistParameters, side: int) -> TunedConfig:
    return TunedConfig(parameters, quality=Quality(interleave=side), light=ONE_BOUNCE)


def _error(runtime: Runtime, views: Sequence[CapturedView], config: TunedConfig) -> float:
    """relMSE, the mean over all views and held-out rotations."""
    rotations = table_rotations(ROTATIONS, 0, held_out=True)
    return float(rotation_errors(runtime, views, config, rotations).mean())


def _main(names: Sequence[str]) -> None:
    def progress(stage: str, share: float) -> None:
        print(f"{stage} {share:.0%}", file=sys.stderr)

    curves = [measured_curves(name, present_scenes()[name], progress) for name in names]
    write_curves(REPOSITORY / "out" / "density" / "-".join(names), curves)
    for row in (*curve_rows(curves), *relaxation_rows(names, present_scenes(), progress)):
        print(f"{row.name:45s} {row.value:10.4g} {row.against_value:10.4g} {row.ratio:8.3f}  {row.against}")


def _fit(views: Sequence[CapturedView], start: ArtistParameters) -> PlacementFit:
    """Fit falloff and maps to relMSE, which is the same measure for all densities and counts."""
    return fit_placement(views, start)


if __name__ == "__main__":
    _main(sys.argv[1:])
