"""How good `auto` is on scenes outside its training, against the defaults and each scene's own fit.

The scenes are generated and third-party ones, as for `vpltune train-prior`. For each scene, a prior is
trained without it, and the runtime's images are compared with the path tracer. The figures of each scene are
written to out/auto/scenes.json.

`python -m benchmarks.tuning.auto FOLDER` writes the clip of `benchmarks.quality.carried_light`, in which a
lamp is carried from a small room into a hall.
"""

import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import moderngl
import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import REPOSITORY, scenes_folder
from benchmarks.quality.carried_light import write_carried_light
from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS, AutoPrior
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.strict_json import strict_json
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.scene.scene import Scene, scaled
from vpltune.renderer.scene.views import scaled_view
from vpltune.tuner.evaluation.evaluate import SPLITS
from vpltune.tuner.metrics.view_metrics import relmse
from vpltune.tuner.prior.loss_table import LossTable, table_loss
from vpltune.tuner.prior.prior_library import RSM_RESOLUTION, prior_references, prior_views
from vpltune.tuner.prior.prior_training import FLOOR, own_fits
from vpltune.tuner.prior.train_prior import LearntPrior, collected_scenes, learn_prior, scene_sources
from vpltune.tuner.surrogate.compiled_functions import keep_compiled_functions

GENERATED = 32
"""Generated scenes: as many as the shipped prior is trained on."""
VPL_COUNT = 64
"""VPLs of every image. A choice: one of the counts that the prior is trained with."""
SCALED_SCENES = 5
"""Scenes that are drawn at other scales. A choice."""
SCALES = (0.01, 100.0)
"""Factors of the scene's size. A choice."""
SCALE_TOLERANCE = 1e-3
"""Relative RMSE by which an image may change with scale: rounding may move a silhouette by a pixel. A
choice."""
RATIO_LIMIT, SHARE_LIMIT, GAP_LIMIT = 1.15, 0.9, 0.1
"""Limits: relMSE of `auto` over a fit's, share of scenes that are better than with the defaults, and relative
gap between the loss on other views and on a fit's own. A choice."""
QUALITY = Quality(rsm_resolution=RSM_RESOLUTION)
"""The quality settings that the prior's training scenes are captured with."""


@dataclass(frozen=True, eq=False)
class _Measured:
    """relMSE of one scene by config: means over the views of the fit, and over the held-out views."""

    name: str
    auto: tuple[float, float]
    fit: tuple[float, float]
    default: tuple[float, float]


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Medians over scenes, the gap to other views, the change with scale, and a row for each scene."""
    keep_compiled_functions()
    folder = scenes_folder()
    sources = scene_sources(folder if folder.is_dir() else None, GENERATED, 0)
    scenes, _ = collected_scenes(sources, progress)
    learnt = learn_prior(scenes, progress)
    with create_context() as context:
        measured = []
        for index, each in enumerate(scenes):
            progress("runtime images", index / len(scenes))
            measured.append(_measured(context, learnt, index, sources[each.name]()))
        changes = [
            _scale_change(context, learnt.unseen[index], sources[scenes[index].name]())
            for index in range(SCALED_SCENES)
        ]
    document = {each.name: asdict(each) for each in measured}
    write_text_whole(REPOSITORY / "out" / "auto" / "scenes.json", strict_json(document) + "\n")
    return [
        *_summary(measured),
        _gap(learnt),
        Row("auto_scale_change", max(changes), "relative RMSE", f"limit, ×{SCALES}", SCALE_TOLERANCE),
        *(
            Row(f"auto.{each.name}.relmse", each.auto[1], "1", "its own fit", each.fit[1])
            for each in measured
        ),
    ]


def _measured(context: moderngl.Context, learnt: LearntPrior, index: int, scene: Scene) -> _Measured:
    """Measure the scene with number `index` of `learnt`."""
    views = prior_views(scene)
    references = prior_references(scene, views)
    default = TunedConfig(ArtistParameters(vpl_count=VPL_COUNT), quality=QUALITY)
    point = learnt.fits.points[index, learnt.fits.vpl_counts.index(VPL_COUNT)]
    configs = {
        "auto": replace(default, auto=learnt.unseen[index]),
        "fit": default.with_parameters(_at(point, default.parameters)),
        "default": default,
    }
    runtime = Runtime(scene, context=context)
    errors = {}
    for name, config in configs.items():
        of_views = []
        for view, reference in zip(views, references, strict=True):
            captured = runtime.capture(view, config, maps=False)
            valid = captured.valid & reference.valid
            of_views.append(relmse(captured.indirect_irradiance[valid], reference.irradiance[valid]))
        errors[name] = tuple(
            float(np.mean([e for e, v in zip(of_views, views, strict=True) if v.split == split]))
            for split in SPLITS
        )
    return _Measured(scene.name, **errors)


def _at(point: np.ndarray, rest: ArtistParameters) -> ArtistParameters:
    """The parameters at a point of the prior's unit cube; the others are those of `rest`."""
    values = {
        name: parameter_spec(name).within(float(place))
        for name, place in zip(AUTO_PARAMETERS, point, strict=True)
    }
    return replace(rest, **values)


def _summary(measured: list[_Measured]) -> list[Row]:
    auto, fit, default = (
        np.array([getattr(each, name) for each in measured]) for name in ("auto", "fit", "default")
    )
    over_fit = np.median(auto / fit, axis=0)
    about = f"limit; median over {len(measured)} scenes outside the training set, {VPL_COUNT} VPLs"
    better = float(np.mean(auto.mean(axis=1) < default.mean(axis=1)))
    return [
        Row("auto_over_fit_relmse", float(over_fit[1]), "1", f"{about}, on held-out views", RATIO_LIMIT),
        Row("auto_over_fit_relmse_fitted", float(over_fit[0]), "1", f"{about}, on fitted views", RATIO_LIMIT),
        Row("beats_defaults_share", better, "of scenes", "limit", SHARE_LIMIT),
        Row(
            "auto_over_default_relmse",
            float(np.median(auto.mean(axis=1) / default.mean(axis=1))),
            "1",
            "the defaults; median over scenes",
            1.0,
        ),
    ]


def _gap(learnt: LearntPrior) -> Row:
    """How much worse a fit to half the views is on the other half than that half's own fit.

    Every view has its own light. Losses are the surrogate's at `VPL_COUNT` VPLs, and the references' noise is
    added to both.
    """
    other = own_fits(learnt.scenes, held_out=True)
    which = learnt.fits.vpl_counts.index(VPL_COUNT)
    gaps = []
    for index, scene in enumerate(learnt.scenes):
        rows = ~scene.fitted & (scene.vpl_count == VPL_COUNT)
        table = jax.tree.map(lambda values, r=rows: jnp.asarray(values[r]), scene.table)
        tested, own = (
            max(float(_mean_loss(table, fits.points[index, which])), 0.0) + FLOOR
            for fits in (learnt.fits, other)
        )
        gaps.append(tested / own - 1.0)
    return Row(
        "fit_gap_other_half", float(np.median(gaps)), "of the loss", "limit; median over scenes", GAP_LIMIT
    )


@jax.jit
def _mean_loss(table: LossTable, point: np.ndarray) -> jax.Array:
    return jax.vmap(table_loss, in_axes=(0, None))(table, point).mean()


def _scale_change(context: moderngl.Context, prior: AutoPrior, scene: Scene) -> float:
    """The largest relative RMSE between an image drawn with `auto` and that of the scene at another scale."""
    config = TunedConfig(ArtistParameters(vpl_count=VPL_COUNT), auto=prior, quality=QUALITY)
    (view,) = prior_views(scene)[:1]

    def image(factor: float) -> np.ndarray:
        runtime = Runtime(scaled(scene, factor), context=context)
        return runtime.render_radiance(scaled_view(view, factor), config)

    plain = image(1.0)
    return max(float(np.sqrt(np.mean((image(factor) - plain) ** 2) / np.mean(plain**2))) for factor in SCALES)


if __name__ == "__main__":
    write_carried_light(Path(sys.argv[1]))
