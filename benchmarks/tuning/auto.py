"""How good `auto` is on scenes outside its training, against the defaults and each scene's own fit.

The shipped prior is trained on generated scenes alone. It is judged on scenes generated from a seed that
chose nothing (docs/chosen_on.md), and on all shipped and third-party ones. Every image is drawn by the
runtime and compared with the path tracer. The figures of each scene are written to out/auto/scenes.json.

`python -m benchmarks.tuning.auto FOLDER` writes the clip of `benchmarks.quality.carried_light`, in which a
lamp is carried from a small room into a hall.
"""

import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path

import moderngl
import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import REPORTED_SEED, REPOSITORY, present_scenes
from benchmarks.quality.carried_light import write_carried_light
from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS
from vpltune.renderer.config.tuned_config import TunedConfig, read_config
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.strict_json import strict_json
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.scene.scene import Scene, scaled
from vpltune.renderer.scene.views import scaled_view
from vpltune.tuner.metrics.view_metrics import mean_metrics
from vpltune.tuner.prior.prior_library import CONFIG, PriorScene, prior_references, prior_views
from vpltune.tuner.prior.prior_training import own_fits
from vpltune.tuner.prior.scene_generator import generated_name, generated_scene
from vpltune.tuner.prior.train_prior import collected_scenes, library_scene
from vpltune.tuner.surrogate.captured_view import capture_views
from vpltune.tuner.surrogate.compiled_functions import keep_compiled_functions

GENERATED = 20
"""Generated scenes, four of a kind. A choice."""
SCALED_SCENES = 5
"""Scenes that are drawn at other scales. A choice."""
SCALES = (0.01, 100.0)
"""Factors of the scene's size. A choice."""
SCALE_TOLERANCE = 1e-3
"""Relative RMSE by which an image may change with scale: rounding may move a silhouette by a pixel. A
choice."""
RATIO_LIMIT, SHARE_LIMIT = 1.03, 0.8
"""Limits: relMSE of `auto` over a fit's, and the share of scenes that are better than with the defaults. A
choice."""
FIGURES = ("relmse", "trimmed_relmse", "flip")


@dataclass(frozen=True, eq=False)
class _Measured:
    """The figures of one scene: means over its views, by config."""

    name: str
    auto: dict[str, float]
    fit: dict[str, float]
    default: dict[str, float]


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Medians over scenes, the shares that are better, the change with scale, and a row for each scene."""
    keep_compiled_functions()
    sources: dict[str, Callable[[], Scene]] = {
        generated_name(number): partial(generated_scene, number, REPORTED_SEED) for number in range(GENERATED)
    }
    sources |= {name: partial(library_scene, path, name) for name, path in present_scenes().items()}
    scenes, _ = collected_scenes(sources, progress)
    measured = []
    with create_context() as context:
        for index, each in enumerate(scenes):
            progress("runtime images", index / len(scenes))
            measured.append(_measured(context, each, sources[each.name]()))
        changes = [_scale_change(context, sources[each.name]()) for each in scenes[:SCALED_SCENES]]
    document = {each.name: asdict(each) for each in measured}
    write_text_whole(REPOSITORY / "out" / "auto" / "scenes.json", strict_json(document) + "\n")
    return [
        *summary_rows([asdict(each) for each in measured]),
        Row("auto_scale_change", max(changes), "relative RMSE", f"limit, ×{SCALES}", SCALE_TOLERANCE),
        *(
            Row(f"auto.{each.name}.{figure}", each.auto[figure], "1", "the defaults", each.default[figure])
            for each in measured
            for figure in FIGURES
        ),
    ]


def summary_rows(measured: list[dict]) -> list[Row]:
    """Medians and shares over scenes; each has the figures of `auto`, `fit` and `default` by name."""

    def ratios(figure: str, against: str) -> np.ndarray:
        return np.array([each["auto"][figure] / each[against][figure] for each in measured])

    about = f"median over {len(measured)} scenes outside the training"
    better = np.all([ratios(figure, "default") < 1.0 for figure in ("relmse", "flip")], axis=0)
    return [
        Row(
            "auto_over_fit_relmse",
            float(np.median(ratios("relmse", "fit"))),
            "1",
            f"limit; {about}",
            RATIO_LIMIT,
        ),
        Row(
            "beats_defaults_share",
            float(better.mean()),
            "of scenes",
            "limit; in relMSE and FLIP",
            SHARE_LIMIT,
        ),
        *(
            Row(
                f"auto_over_default_{figure}",
                float(np.median(ratios(figure, "default"))),
                "1",
                f"the defaults; {about}",
                1.0,
            )
            for figure in FIGURES
        ),
    ]


def _measured(context: moderngl.Context, captured: PriorScene, scene: Scene) -> _Measured:
    """Draw and measure one scene with the shipped prior, its own fit and the defaults."""
    views = prior_views(scene)
    references = prior_references(scene, views)
    parameters = ArtistParameters()
    fits = own_fits((captured,))
    point = fits.points[0, fits.vpl_counts.index(parameters.vpl_count)]
    default = replace(CONFIG, parameters=parameters)
    configs = {
        "auto": replace(read_config("auto"), parameters=parameters, quality=CONFIG.quality),
        "fit": default.with_parameters(_at(point, parameters)),
        "default": default,
    }
    runtime = Runtime(scene, context=context)
    figures = {}
    for name, config in configs.items():
        drawn = capture_views(runtime, config, views, references, maps=False)
        mean = mean_metrics([each.metrics(each.captured.indirect_irradiance) for each in drawn]).as_dict()
        figures[name] = {figure: mean[figure] for figure in FIGURES}
    return _Measured(scene.name, **figures)


def _at(point: np.ndarray, rest: ArtistParameters) -> ArtistParameters:
    """The parameters at a point of the prior's unit cube; the others are those of `rest`."""
    values = {
        name: parameter_spec(name).within(float(place))
        for name, place in zip(AUTO_PARAMETERS, point, strict=True)
    }
    return replace(rest, **values)


def _scale_change(context: moderngl.Context, scene: Scene) -> float:
    """The largest relative RMSE between an image drawn with `auto` and that of the scene at another scale."""
    config: TunedConfig = replace(read_config("auto"), quality=CONFIG.quality)
    (view,) = prior_views(scene)[:1]

    def image(factor: float) -> np.ndarray:
        runtime = Runtime(scaled(scene, factor), context=context)
        return runtime.render_radiance(scaled_view(view, factor), config)

    plain = image(1.0)
    return max(float(np.sqrt(np.mean((image(factor) - plain) ** 2) / np.mean(plain**2))) for factor in SCALES)


if __name__ == "__main__":
    write_carried_light(Path(sys.argv[1]))
