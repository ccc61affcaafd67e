"""What each kind of visibility leaves of the error: none, mean transmittance, maps, rays; untuned and tuned.

Every scene that can be loaded, three views with a light position each, `VPLS` VPLs: fitted on two of them,
measured on those and on the third. The ceiling has the same VPLs and rays towards every pixel; maps that are
not refined show what the rays at silhouettes are worth.

`python -m benchmarks.quality.visibility_quality FILE [SCENE …]` writes each scene's figures into a JSON file as they
come, keeps what is there, and ends with the summary and the scenes that were named: a long run may be done in
pieces.
"""

import json
import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path
from statistics import median

import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import present_scenes
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig, Visibility
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.tuner.evaluation.evaluate import SPLITS, surrogate_irradiance
from vpltune.tuner.evaluation.prepare_scene import PreparedScene, SceneOptions, Stopwatch, prepare_scene
from vpltune.tuner.fitting.fit_placement import fit_placement
from vpltune.tuner.fitting.fit_views import robust_errors
from vpltune.tuner.fitting.search_space import held_for
from vpltune.tuner.metrics.view_metrics import mean_metrics, view_metrics
from vpltune.tuner.reference import ray_traced_visibility
from vpltune.tuner.surrogate.captured_view import CapturedView, capture_views, runtime_irradiance

VPLS = 256
MODES: tuple[Visibility, ...] = ("none", "transmittance", "maps")
UNREFINED = "maps_unrefined"
CEILING = "ceiling"
STATES = ("untuned", "tuned")
DEFAULT = ArtistParameters(vpl_count=VPLS)

Figures = dict[str, dict[str, dict[str, dict[str, float]]]]
"""By mode, state and split: relmse, energy_ratio, flip."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """The summary, then for each scene, mode, state and split its relMSE against the ceiling's, its energy
    against the reference's and its HDR-FLIP against the ceiling's."""
    scenes = present_scenes()
    measured = {}
    for index, name in enumerate(scenes):
        progress(f"visibility_quality: {name}", index / len(scenes))
        measured[name] = scene_figures(scenes[name])
    progress("visibility_quality", 1.0)
    return [*summary_rows(measured), *(row for name in measured for row in _rows_of(name, measured[name]))]


def scene_figures(path: Path) -> Figures:
    """All figures of one scene."""
    figures: Figures = {}
    for mode in MODES:
        prepared = _prepared(path, mode)
        figures[mode] = _drawn_figures(prepared)
    figures[UNREFINED] = _drawn_figures(_unrefined(prepared))
    seen = {view.view.name: ray_visibility(prepared, view) for view in prepared.views}
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
    """Over scenes and splits: the median and the worst ratio of maps to ceiling, in relMSE, and the median of
    that of maps that are not refined."""
    found = []
    for state in STATES:
        ratios = _over_ceiling(measured, "maps", state)
        worst = max(ratios, key=lambda name: ratios[name])
        unrefined = median(_over_ceiling(measured, UNREFINED, state).values())
        found += [
            Row(f"maps_over_ceiling_{state}_median", median(ratios.values()), "1", "limit", 1.5),
            Row(f"maps_over_ceiling_{state}_worst", ratios[worst], "1", f"limit; {worst}", 3.0),
            Row(f"{UNREFINED}_over_ceiling_{state}_median", unrefined, "1", CEILING, 1.0),
        ]
    return found


def _over_ceiling(measured: dict[str, Figures], mode: str, state: str) -> dict[str, float]:
    """By scene and split: relMSE over the ceiling's."""
    return {
        f"{name}.{split}": figures[mode][state][split]["relmse"] / ceiling
        for name, figures in measured.items()
        for split in SPLITS
        # A scene without indirect light has nothing to compare.
        if (ceiling := figures[CEILING][state][split]["relmse"]) > 1e-6
    }


def _prepared(path: Path, mode: Visibility) -> PreparedScene:
    config = TunedConfig(DEFAULT, visibility=mode)
    return prepare_scene(path, SceneOptions(views=2), config, Stopwatch(), lambda stage, share: None)


def _unrefined(prepared: PreparedScene) -> PreparedScene:
    """The same with maps of one ray a texel at silhouettes too."""
    config = TunedConfig(DEFAULT, visibility=prepared.runtime.visibility)
    options = RuntimeOptions(visibility_map_refinement=1)
    runtime = Runtime(prepared.scene, config, options, context=prepared.runtime.context)
    references = tuple(view.reference for view in prepared.views)
    captured = capture_views(runtime, tuple(view.view for view in prepared.views), references)
    return replace(prepared, runtime=runtime, views=captured)


def _drawn_figures(prepared: PreparedScene) -> dict[str, dict[str, dict[str, float]]]:
    """By state and split, as the runtime draws them."""
    runtime = prepared.runtime
    tuned = _tuned(_of_fitted(prepared.views), runtime.visibility)
    return {
        state: _figures(prepared.views, lambda view, p=parameters: runtime_irradiance(runtime, p, view))
        for state, parameters in zip(STATES, (DEFAULT, tuned), strict=True)
    }


def _of_fitted(views: tuple[CapturedView, ...]) -> tuple[CapturedView, ...]:
    return tuple(view for view in views if view.view.split == "fitted")


def _tuned(views: tuple[CapturedView, ...], mode: Visibility) -> ArtistParameters:
    return fit_placement(views, DEFAULT, robust_errors(views), held=held_for(mode)).parameters


def ray_visibility(prepared: PreparedScene, view: CapturedView) -> np.ndarray:
    """What rays from every receiver to every VPL of a view tell, [receivers, vpls] in {0, 1}."""
    captured = view.captured
    return ray_traced_visibility(
        prepared.scene,
        captured.position_world[captured.valid].astype(np.float64),
        captured.normal_world[captured.valid],
        captured.vpl_position_world.astype(np.float64),
        captured.vpl_normal_world,
    )


def _figures(
    views: tuple[CapturedView, ...], irradiance: Callable[[CapturedView], np.ndarray]
) -> dict[str, dict[str, float]]:
    found = {}
    for split in SPLITS:
        metrics = []
        for view in views:
            if view.view.split == split:
                image = irradiance(view)
                radiances = view.runtime_radiance(image), view.reference_radiance()
                metrics.append(view_metrics(image, view.reference.irradiance, *radiances, view.valid))
        found[split] = asdict(mean_metrics(metrics))
    return found


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
