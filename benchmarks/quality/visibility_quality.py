"""The error with each kind of visibility: mean transmittance, maps, and rays; untuned and tuned.

Every scene has `VPLS` VPLs and three views with a light position each. Parameters are fitted to two of the
views, and measured on these and on the held-out third. Untuned, the mean transmittance is 1, which is no
visibility at all. The ceiling has the same VPLs, with rays towards every pixel. Maps without refinement tell
what the extra rays at silhouettes are worth.

`python -m benchmarks.quality.visibility_quality FILE [SCENE …]` writes the figures of each scene to a JSON
file as soon as they are measured. It skips scenes that the file already has, so that a long run can be split.
At the end it prints the summary, and the rows of the scenes that were named.
"""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import present_scenes
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.tuner.evaluation.evaluate import SPLITS, surrogate_irradiance, traced_visibility
from vpltune.tuner.evaluation.prepare_scene import PreparedScene, SceneOptions, Stopwatch, prepare_scene
from vpltune.tuner.fitting.fit_placement import fit_placement
from vpltune.tuner.fitting.fit_views import robust_errors
from vpltune.tuner.metrics.view_metrics import mean_metrics
from vpltune.tuner.surrogate.captured_view import CapturedView, capture_views, runtime_irradiance

VPLS = 256
"""VPLs of every view. A choice."""
FITTED_VIEWS = 2
"""Views of each scene that are fitted; a third is held out. A choice."""
DEFAULT = ArtistParameters(vpl_count=VPLS)
CONFIGS = {
    "transmittance": TunedConfig(DEFAULT, visibility="transmittance", light=ONE_BOUNCE),
    "maps": TunedConfig(DEFAULT, visibility="maps", light=ONE_BOUNCE),
    "maps_unrefined": TunedConfig(
        DEFAULT, visibility="maps", quality=Quality(map_refinement=1), light=ONE_BOUNCE
    ),
}
"""The untuned config of each kind of visibility."""
UNREFINED = "maps_unrefined"
CEILING = "ceiling"
STATES = ("untuned", "tuned")
MEDIAN_LIMIT, WORST_LIMIT = 1.5, 3.0
"""relMSE of maps over that of the ceiling: limits for the median and for the worst scene. A choice."""
LEAST_RELMSE = 1e-6
"""Ceilings below this are of scenes without indirect light, which have no ratio. A choice."""

Figures = dict[str, dict[str, dict[str, dict[str, float]]]]
"""The figures of `ViewMetrics` by kind of visibility, state and split."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """The summary, then three rows for each scene, kind of visibility, state and split.

    These compare relMSE and HDR-FLIP with the ceiling's, and the energy ratio with 1.
    """
    scenes = present_scenes()
    measured = {}
    for index, name in enumerate(scenes):
        progress(f"visibility_quality: {name}", index / len(scenes))
        measured[name] = scene_figures(scenes[name])
    progress("visibility_quality", 1.0)
    return [*summary_rows(measured), *(row for name in measured for row in _rows_of(name, measured[name]))]


def scene_figures(path: Path) -> Figures:
    """Measure one scene with every kind of visibility, and its ceiling."""
    options = SceneOptions(views=FITTED_VIEWS)
    prepared = prepare_scene(path, options, CONFIGS["maps"], Stopwatch(), lambda stage, share: None)
    figures = {mode: _drawn_figures(prepared, mode) for mode in CONFIGS}
    seen = {view.view.name: traced_visibility(prepared.scene, view) for view in prepared.views}
    fitted = _of_fitted(prepared.views)
    of_rays = [seen[view.view.name] for view in fitted]
    tuned = fit_placement(fitted, DEFAULT, robust_errors(fitted), visibility=of_rays).parameters
    figures[CEILING] = {
        state: _figures(
            prepared.views, lambda view, p=parameters: surrogate_irradiance(view, p, seen[view.view.name])
        )
        for state, parameters in zip(STATES, (DEFAULT, tuned), strict=True)
    }
    return figures


def summary_rows(measured: dict[str, Figures]) -> list[Row]:
    """The median and the worst ratio of relMSE, maps over ceiling, over all scenes and splits.

    A third row has the median ratio of maps without refinement.
    """
    found = []
    for state in STATES:
        ratios = _over_ceiling(measured, "maps", state)
        worst = max(ratios, key=lambda name: ratios[name])
        unrefined = median(_over_ceiling(measured, UNREFINED, state).values())
        found += [
            Row(f"maps_over_ceiling_{state}_median", median(ratios.values()), "1", "limit", MEDIAN_LIMIT),
            Row(f"maps_over_ceiling_{state}_worst", ratios[worst], "1", f"limit; {worst}", WORST_LIMIT),
            Row(f"{UNREFINED}_over_ceiling_{state}_median", unrefined, "1", CEILING, 1.0),
        ]
    return found


def _over_ceiling(measured: dict[str, Figures], mode: str, state: str) -> dict[str, float]:
    """relMSE over the ceiling's, by scene and split."""
    return {
        f"{name}.{split}": figures[mode][state][split]["relmse"] / ceiling
        for name, figures in measured.items()
        for split in SPLITS
        if (ceiling := figures[CEILING][state][split]["relmse"]) > LEAST_RELMSE
    }


def _drawn_figures(prepared: PreparedScene, mode: str) -> dict[str, dict[str, dict[str, float]]]:
    """The figures of the runtime's images with one kind of visibility, by state and split."""
    runtime, config = prepared.runtime, CONFIGS[mode]
    references = tuple(view.reference for view in prepared.views)
    views = capture_views(runtime, config, tuple(view.view for view in prepared.views), references)
    fitted = _of_fitted(views)
    tuned = fit_placement(fitted, DEFAULT, robust_errors(fitted)).parameters
    return {
        state: _figures(views, lambda view, c=chosen: runtime_irradiance(runtime, c, view))
        for state, chosen in zip(STATES, (config, config.with_parameters(tuned)), strict=True)
    }


def _of_fitted(views: tuple[CapturedView, ...]) -> tuple[CapturedView, ...]:
    return tuple(view for view in views if view.view.split == "fitted")


def _figures(
    views: tuple[CapturedView, ...], irradiance: Callable[[CapturedView], np.ndarray]
) -> dict[str, dict[str, float]]:
    """Mean figures of the views of each split, whose images `irradiance` makes."""
    return {
        split: mean_metrics(
            [view.metrics(irradiance(view)) for view in views if view.view.split == split]
        ).as_dict()
        for split in SPLITS
    }


def _rows_of(name: str, figures: Figures) -> list[Row]:
    return [
        row
        for mode in figures
        for state in STATES
        for split in SPLITS
        for row in _figure_rows(
            f"{name}.{split}.{mode}.{state}", *(figures[m][state][split] for m in (mode, CEILING))
        )
    ]


def _figure_rows(name: str, own: dict[str, float], ceiling: dict[str, float]) -> list[Row]:
    return [
        Row(f"{name}.relmse", own["relmse"], "1", CEILING, ceiling["relmse"]),
        Row(f"{name}.energy_ratio", own["energy_ratio"], "1", "the reference", 1.0),
        Row(f"{name}.flip", own["flip"], "1", CEILING, ceiling["flip"]),
    ]


def _main(path: Path, names: list[str]) -> None:
    measured = json.loads(path.read_text()) if path.exists() else {}
    scenes = present_scenes()
    for name in names or list(scenes):
        if UNREFINED not in measured.get(name, {}):
            measured[name] = scene_figures(scenes[name])
            write_text_whole(path, json.dumps(measured, indent=1) + "\n")
            print(name, flush=True)
    complete = {name: figures for name, figures in measured.items() if UNREFINED in figures}
    for row in [*summary_rows(complete), *(row for name in names for row in _rows_of(name, measured[name]))]:
        print(f"{row.name} {row.value:.3f} ({row.against} {row.against_value:g})")


if __name__ == "__main__":
    _main(Path(sys.argv[1]), sys.argv[2:])
