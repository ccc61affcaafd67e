"""What the plain squared error beside relMSE gives and costs: error, energy and FLIP for several shares."""

from collections.abc import Callable
from statistics import fmean, geometric_mean

from benchmarks.row import Row
from benchmarks.scene_library import present_scenes
from renderer.artist_parameters import ArtistParameters
from renderer.runtime import Runtime
from renderer.tuned_config import TunedConfig
from tuner.captured_view import CapturedView, runtime_irradiance
from tuner.fit_falloff import fit_falloff
from tuner.prepare_scene import SceneOptions, Stopwatch, prepare_scene
from tuner.view_metrics import ViewMetrics, mean_metrics, view_metrics

SHARES = (0.0, 3.0, 10.0, 30.0, 100.0)
SCENES = (
    "bevy-cornellbox",
    "cornell-box",
    "cube2-steelribs",
    "gallery",
    "godot-living-room",
    "godot-zdm2",
    "kajiya-cornell-box",
    "nvpro-cornellbox",
)


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """For each share: relMSE and FLIP over the default's (geometric means) and the mean error of energy."""
    present = {name: path for name, path in present_scenes().items() if name in SCENES}
    ratios: dict[float, list[tuple[float, float, float]]] = {share: [] for share in SHARES}
    for index, path in enumerate(present.values()):
        progress("even_share", index / len(present))
        prepared = prepare_scene(path, SceneOptions(), TunedConfig(), Stopwatch(), lambda *_: None)
        fitted = tuple(view for view in prepared.views if view.view.split == "fitted")
        default = _mean(prepared.runtime, prepared.views, ArtistParameters())
        for share in SHARES:
            parameters, _ = fit_falloff(fitted, ArtistParameters(), even_share=share)
            tuned = _mean(prepared.runtime, prepared.views, parameters)
            ratios[share].append(
                (tuned.relmse / default.relmse, tuned.flip / default.flip, abs(tuned.energy_ratio - 1.0))
            )
    progress("even_share", 1.0)
    return [
        row
        for share, values in ratios.items()
        for row in (
            Row(f"share_{share:g}_relmse", geometric_mean(v[0] for v in values), "1", "default", 1.0),
            Row(f"share_{share:g}_flip", geometric_mean(v[1] for v in values), "1", "default", 1.0),
            Row(f"share_{share:g}_energy_error", fmean(v[2] for v in values), "1", "design's aim", 0.03),
        )
    ]


def _mean(runtime: Runtime, views: tuple[CapturedView, ...], parameters: ArtistParameters) -> ViewMetrics:
    measured = []
    for view in views:
        irradiance = runtime_irradiance(runtime, parameters, view)
        measured.append(
            view_metrics(
                irradiance,
                view.reference.irradiance,
                view.runtime_radiance(irradiance),
                view.reference_radiance(),
                view.valid,
            )
        )
    return mean_metrics(measured)
