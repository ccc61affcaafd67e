"""Measures default, tuned and ceiling against the reference, on fitted and on held-out views.

The ceiling has the same VPLs with ray-traced visibility at every pixel, and falloff parameters fitted to
that. No choice of falloff parameters can remove the error that it has left.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float32

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import Scene
from vpltune.tuner.fitting.fit_placement import fit_placement
from vpltune.tuner.fitting.fit_views import robust_errors
from vpltune.tuner.metrics.view_metrics import ViewMetrics, mean_metrics
from vpltune.tuner.reference import noise_floor, ray_traced_visibility
from vpltune.tuner.surrogate.captured_view import PIXELS_STEP, CapturedView, runtime_irradiance
from vpltune.tuner.surrogate.tabulated_gather import Visibility
from vpltune.tuner.surrogate.virtual_point_lights import gather_inputs
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather
from vpltune.tuner.surrogate.wide_vectors import wide_jit

CEILING_TURNS = 2
"""Reweighting iterations of the ceiling's fit, which begins at the tuned parameters. A choice."""
VARIANTS = ("default", "tuned", "ceiling")
SPLITS = ("fitted", "held_out")

_gather = wide_jit(gather)


@dataclass(frozen=True, eq=False)
class EvaluatedView:
    """The three images of one view, and their errors against the reference."""

    view: CapturedView
    tuned: TunedConfig
    """The config that `tuned` was drawn with in this view; a prior sets its parameters view by view."""
    irradiance: dict[str, Float32[np.ndarray, "height width 3"]]
    """Indirect irradiance [W/m²] by variant: `default` and `tuned` from the runtime, `ceiling` from the
    surrogate."""
    metrics: dict[str, ViewMetrics]
    """Errors by variant."""
    noise_floor: float
    """relMSE that the reference's noise alone adds."""

    @property
    def changed(self) -> bool:
        """Whether tuned draws another image than default."""
        return not np.array_equal(self.irradiance["default"], self.irradiance["tuned"])


@dataclass(frozen=True, eq=False)
class Evaluation:
    """All views, and the fitted parameters of the ceiling."""

    views: tuple[EvaluatedView, ...]
    ceiling_parameters: ArtistParameters

    def summary(self) -> dict[str, Any]:
        """Mean metrics of each split by variant: the key `metrics` of what `fit` and `evaluate` report."""
        return {split: self._split(split) for split in SPLITS}

    def per_view(self) -> list[dict[str, Any]]:
        """Metrics, parameters and reference samples of each view: the key `per_view`."""
        return [
            {
                "name": evaluated.view.view.name,
                "split": evaluated.view.view.split,
                "parameters": evaluated.tuned.parameters.as_dict(),
                **{variant: evaluated.metrics[variant].as_dict() for variant in VARIANTS},
                "noise_floor": evaluated.noise_floor,
                "samples": evaluated.view.reference.samples,
            }
            for evaluated in self.views
        ]

    def notes(self) -> tuple[str, ...]:
        """Remarks on the figures, one sentence each."""
        unlit = [each.view.view.name for each in self.views if not each.view.lit]
        if not unlit:
            return ()
        return (f"no indirect light reaches {', '.join(unlit)}: relMSE and energy ratio have no value there",)

    def most_and_least_gained(self) -> tuple[tuple[str, EvaluatedView], ...]:
        """The views in which tuned gains most and least over default, by trimmed relMSE, with a label each.

        This is one view if both are the same, and the first view if indirect light reaches none, or if tuned
        draws what default does.
        """
        measured = [
            (each.metrics["tuned"].trimmed_relmse / each.metrics["default"].trimmed_relmse, index)
            for index, each in enumerate(self.views)
            if each.metrics["default"].trimmed_relmse > 0.0
        ]
        if not measured:
            return (("no indirect light", self.views[0]),)
        if not any(each.changed for each in self.views):
            return (("default kept", self.views[0]),)
        labels = {min(measured)[1]: "gained most"}
        labels.setdefault(max(measured)[1], "gained least" if max(measured)[0] <= 1.0 else "lost most")
        return tuple((label, self.views[index]) for index, label in labels.items())

    def _split(self, split: str) -> dict[str, Any]:
        views = [evaluated for evaluated in self.views if evaluated.view.view.split == split]
        if not views:
            return {}
        means = {
            variant: mean_metrics([evaluated.metrics[variant] for evaluated in views]).as_dict()
            for variant in VARIANTS
        }
        return {**means, "noise_floor": float(np.mean([evaluated.noise_floor for evaluated in views]))}


def evaluate(
    scene: Scene,
    runtime: Runtime,
    views: tuple[CapturedView, ...],
    default: TunedConfig,
    tuned: TunedConfig | None,
    *,
    seed: int = 0,
    known: Sequence[CapturedView] = (),
    progress: Callable[[float], None] | None = None,
) -> Evaluation:
    """Measure default, tuned and ceiling in every view.

    Args:
        scene: traced for the ceiling's visibility.
        runtime: draws the same scene.
        views: captured with the VPLs of `tuned`.
        default: the config that `tuned` is compared with.
        tuned: the config to measure. None takes the config that each view was captured with, where a prior
            set the parameters.
        seed: selects the pixels that the ceiling is fitted to.
        known: other captures of the same views; images that they hold are not drawn again.
        progress: called with the share done, in [0, 1].

    Raises:
        MachineError: the GPU ran out of memory or reported an error.
    """
    visibilities = []
    for index, view in enumerate(views):
        visibilities.append(traced_visibility(scene, view))
        if progress is not None:
            progress(0.5 * (index + 1) / len(views))
    fitted = [i for i, view in enumerate(views) if view.view.split == "fitted"]
    ceiling = fit_placement(
        [views[i] for i in fitted],
        (default if tuned is None else tuned).parameters,
        robust_errors([views[i] for i in fitted], seed=seed),
        seed=seed,
        visibility=[visibilities[i] for i in fitted],
        turns=CEILING_TURNS,
    ).parameters
    evaluated = []
    for index, (view, visibility) in enumerate(zip(views, visibilities, strict=True)):
        chosen = view.drawn_with if tuned is None else tuned
        assert chosen is not None, "a view that a prior was captured with knows its config"
        evaluated.append(_evaluate_view(runtime, view, known, default, chosen, ceiling, visibility))
        if progress is not None:
            progress(0.5 + 0.5 * (index + 1) / len(views))
    return Evaluation(tuple(evaluated), ceiling)


def _evaluate_view(
    runtime: Runtime,
    view: CapturedView,
    known: Sequence[CapturedView],
    default: TunedConfig,
    tuned: TunedConfig,
    ceiling: ArtistParameters,
    visibility: Bool[np.ndarray, "receivers vpls"],
) -> EvaluatedView:
    images = {
        "default": runtime_irradiance(runtime, default, view, known),
        "tuned": runtime_irradiance(runtime, tuned, view, known),
        "ceiling": surrogate_irradiance(view, ceiling, visibility),
    }
    metrics = {name: view.metrics(image) for name, image in images.items()}
    return EvaluatedView(view, tuned, images, metrics, noise_floor(view.reference))


def traced_visibility(scene: Scene, view: CapturedView) -> Bool[np.ndarray, "receivers vpls"]:
    """Ray-traced visibility of a view's VPLs from all pixels with a surface."""
    captured = view.captured
    return ray_traced_visibility(
        scene,
        captured.position_world[captured.valid].astype(np.float64),
        captured.normal_world[captured.valid],
        captured.vpl_position_world.astype(np.float64),
        captured.vpl_normal_world,
        captured.vpl_footprint.astype(np.float64) if captured.vpls_are_discs else None,
    )


def surrogate_irradiance(
    view: CapturedView,
    parameters: ArtistParameters,
    visibility: Visibility | None = None,
) -> Float32[np.ndarray, "height width 3"]:
    """The surrogate's indirect irradiance of a whole view [W/m²]; zero where no surface is seen.

    `visibility` has a row for each pixel with a surface; None takes all VPLs to be visible.
    """
    valid = view.captured.valid
    count = int(valid.sum())
    # The number of receivers differs between views; repeating some lets views share the compiled gather.
    repeated = np.arange(count + -count % PIXELS_STEP) % max(count, 1)
    receivers, vpls = gather_inputs(view.captured, repeated)
    seen = None if visibility is None else jnp.asarray(visibility, jnp.float32)[repeated]
    image = np.zeros((*valid.shape, 3), np.float32)
    gathered = _gather(receivers, vpls, FalloffParameters.of(parameters), seen)
    image[valid] = np.asarray(gathered)[:count]
    return image
