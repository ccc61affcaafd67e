"""How far `auto` comes on scenes that its prior has not seen: against the defaults and each scene's own fit.

Scenes are generated ones and those of others, as `vpltune train-prior` takes them; for each, the prior is one
that was trained without it, and runtime images are measured against the path tracer. What each scene came
to goes to out/auto/scenes.json.

`python -m benchmarks.tuning.auto FOLDER` writes the clip of a light that is carried from a small room into a hall,
with the parameters plotted under the image.
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
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS, AutoPrior, value_at
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
VPL_COUNT = 64
SCALED_SCENES = 5
SCALES = (0.01, 100.0)
SCALE_TOLERANCE = 1e-3
"""Relative RMSE: where rounding moves a silhouette by a pixel, it may differ."""
WANTED_RATIO, WANTED_SHARE, WANTED_GAP = 1.15, 0.9, 0.1


@dataclass(frozen=True, eq=False)
class _Measured:
    """One scene's relMSE by config, the mean over the fit's views and over the others."""

    name: str
    auto: tuple[float, float]
    fit: tuple[float, float]
    default: tuple[float, float]


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """The medians, the gap between lights and views, scale, and a row for each scene."""
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
    views = prior_views(scene)
    references = prior_references(scene, views)
    base = ArtistParameters(**{**ArtistParameters().as_dict(), "vpl_count": VPL_COUNT})
    fit = _at(learnt.fits.points[index, learnt.fits.vpl_counts.index(VPL_COUNT)], base)
    configs = {
        "auto": TunedConfig(base, visibility="maps", auto=learnt.unseen[index]),
        "fit": TunedConfig(fit, visibility="maps"),
        "default": TunedConfig(base, visibility="maps"),
    }
    errors = {}
    for name, config in configs.items():
        runtime = Runtime(scene, config, context=context, rsm_resolution=RSM_RESOLUTION)
        of_views = []
        for view, reference in zip(views, references, strict=True):
            captured = runtime.capture(view)
            valid = captured.valid & reference.valid
            of_views.append(relmse(captured.indirect_irradiance[valid], reference.irradiance[valid]))
        errors[name] = tuple(
            float(np.mean([e for e, v in zip(of_views, views, strict=True) if v.split == split]))
            for split in SPLITS
        )
    return _Measured(scene.name, **errors)


def _at(point: np.ndarray, rest: ArtistParameters) -> ArtistParameters:
    values = {
        name: value_at(parameter_spec(name), float(place))
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
        Row("auto_over_fit_relmse", float(over_fit[1]), "1", f"{about}, on views new to both", WANTED_RATIO),
        Row(
            "auto_over_fit_relmse_fitted", float(over_fit[0]), "1", f"{about}, on the fit's own", WANTED_RATIO
        ),
        Row("beats_defaults_share", better, "of scenes", "wanted", WANTED_SHARE),
        Row(
            "auto_over_default_relmse",
            float(np.median(auto.mean(axis=1) / default.mean(axis=1))),
            "1",
            "the defaults; median over scenes",
            1.0,
        ),
    ]


def _gap(learnt: LearntPrior) -> Row:
    """A fit on half the views, each with its own light, tested on the other half, against its own fit.

    Through the surrogate, at `VPL_COUNT` VPLs, with the references' noise as the floor of both.
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
        "fit_gap_other_half", float(np.median(gaps)), "of the loss", "limit; median over scenes", WANTED_GAP
    )


@jax.jit
def _mean_loss(table: LossTable, point: np.ndarray) -> jax.Array:
    return jax.vmap(table_loss, in_axes=(0, None))(table, point).mean()


def _scale_change(context: moderngl.Context, prior: AutoPrior, scene: Scene) -> float:
    """The largest relative RMSE between an image drawn with `auto` and the same at another scale."""
    config = TunedConfig(ArtistParameters(vpl_count=VPL_COUNT), visibility="maps", auto=prior)
    (view,) = prior_views(scene)[:1]

    def image(factor: float) -> np.ndarray:
        runtime = Runtime(scaled(scene, factor), config, context=context, rsm_resolution=RSM_RESOLUTION)
        return runtime.render_radiance(scaled_view(view, factor))

    plain = image(1.0)
    return max(float(np.sqrt(np.mean((image(factor) - plain) ** 2) / np.mean(plain**2))) for factor in SCALES)


if __name__ == "__main__":
    write_carried_light(Path(sys.argv[1]))
