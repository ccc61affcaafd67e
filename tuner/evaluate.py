"""Default, tuned and ceiling against the reference, on fitted and on held-out views.

The ceiling is the same VPLs with ray-traced visibility towards every pixel, fitted in its turn: what is left
of its error no choice of the falloff parameters can take away.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float32

from renderer.artist_parameters import ArtistParameters
from renderer.runtime import Runtime
from renderer.scene import Scene
from tuner.captured_view import CapturedView, runtime_irradiance
from tuner.fit_falloff import fit_falloff
from tuner.reference import noise_floor, ray_traced_visibility
from tuner.tabulated_gather import Visibility
from tuner.view_metrics import ViewMetrics, mean_metrics, view_metrics
from tuner.virtual_point_lights import gather_inputs
from tuner.vpl_gather import FalloffParameters, gather
from tuner.wide_vectors import wide_jit

VARIANTS = ("default", "tuned", "ceiling")
SPLITS = ("fitted", "held_out")

_gather = wide_jit(gather)


@dataclass(frozen=True, eq=False)
class EvaluatedView:
    """The three pictures of one view and how far each is from the reference."""

    view: CapturedView
    tuned: ArtistParameters
    irradiance: dict[str, Float32[np.ndarray, "height width 3"]]
    """By variant: `default` and `tuned` as the runtime draws them, `ceiling` from the surrogate."""
    metrics: dict[str, ViewMetrics]
    noise_floor: float


@dataclass(frozen=True, eq=False)
class Evaluation:
    """All views, and the parameters that the ceiling was fitted to."""

    views: tuple[EvaluatedView, ...]
    ceiling_parameters: ArtistParameters

    def summary(self) -> dict[str, Any]:
        """Means over the views of each split: the `metrics` that `fit` and `evaluate` report."""
        return {split: self._split(split) for split in SPLITS}

    def per_view(self) -> list[dict[str, Any]]:
        """The same figures view by view."""
        return [
            {
                "name": evaluated.view.view.name,
                "split": evaluated.view.view.split,
                "parameters": evaluated.tuned.as_dict(),
                **{variant: asdict(evaluated.metrics[variant]) for variant in VARIANTS},
                "noise_floor": evaluated.noise_floor,
                "samples": evaluated.view.reference.samples,
            }
            for evaluated in self.views
        ]

    def notes(self) -> tuple[str, ...]:
        """What the figures do not say of themselves, a sentence each."""
        unlit = [each.view.view.name for each in self.views if not each.view.lit]
        if not unlit:
            return ()
        names = ", ".join(unlit)
        return (f"no indirect light reaches {names}: relMSE and energy ratio have no value there",)

    def _split(self, split: str) -> dict[str, Any]:
        views = [evaluated for evaluated in self.views if evaluated.view.view.split == split]
        if not views:
            return {}
        means = {
            variant: asdict(mean_metrics([evaluated.metrics[variant] for evaluated in views]))
            for variant in VARIANTS
        }
        return {**means, "noise_floor": float(np.mean([evaluated.noise_floor for evaluated in views]))}


def evaluate(
    scene: Scene,
    runtime: Runtime,
    views: tuple[CapturedView, ...],
    default: ArtistParameters,
    tuned: ArtistParameters | None,
    *,
    seed: int = 0,
    progress: Callable[[float], None] | None = None,
) -> Evaluation:
    """Measure every view. `progress` is called with the share done, in [0, 1].

    `tuned` None takes for each view what it was captured with, as a prior set it.
    """
    visibilities = []
    for index, view in enumerate(views):
        visibilities.append(_visibility(scene, view))
        if progress is not None:
            progress(0.5 * (index + 1) / len(views))
    fitted = [i for i, view in enumerate(views) if view.view.split == "fitted"]
    ceiling, _ = fit_falloff(
        tuple(views[i] for i in fitted),
        default,
        seed=seed,
        visibility=tuple(visibilities[i] for i in fitted),
    )
    evaluated = []
    for index, (view, visibility) in enumerate(zip(views, visibilities, strict=True)):
        chosen = view.drawn_with if tuned is None else tuned
        assert chosen is not None, "a view that a prior was captured with knows its parameters"
        evaluated.append(_evaluate_view(runtime, view, default, chosen, ceiling, visibility))
        if progress is not None:
            progress(0.5 + 0.5 * (index + 1) / len(views))
    return Evaluation(tuple(evaluated), ceiling)


def _evaluate_view(
    runtime: Runtime,
    view: CapturedView,
    default: ArtistParameters,
    tuned: ArtistParameters,
    ceiling: ArtistParameters,
    visibility: Bool[np.ndarray, "receivers vpls"],
) -> EvaluatedView:
    pictures = {
        "default": runtime_irradiance(runtime, default, view),
        "tuned": runtime_irradiance(runtime, tuned, view),
        "ceiling": surrogate_irradiance(view, ceiling, visibility),
    }
    reference_radiance = view.reference_radiance()
    metrics = {
        name: view_metrics(
            picture, view.reference.irradiance, view.runtime_radiance(picture), reference_radiance, view.valid
        )
        for name, picture in pictures.items()
    }
    return EvaluatedView(view, tuned, pictures, metrics, noise_floor(view.reference))


def _visibility(scene: Scene, view: CapturedView) -> Bool[np.ndarray, "receivers vpls"]:
    captured = view.captured
    return ray_traced_visibility(
        scene,
        captured.position_world[captured.valid].astype(np.float64),
        captured.normal_world[captured.valid],
        captured.vpl_position_world.astype(np.float64),
        captured.vpl_normal_world,
    )


def surrogate_irradiance(
    view: CapturedView,
    parameters: ArtistParameters,
    visibility: Visibility | None = None,
) -> Float32[np.ndarray, "height width 3"]:
    """The surrogate's indirect irradiance of a whole view, zero where nothing is seen."""
    receivers, vpls = gather_inputs(view.captured)
    picture = np.zeros((*view.captured.valid.shape, 3), np.float32)
    picture[view.captured.valid] = np.asarray(
        _gather(receivers, vpls, FalloffParameters.of(parameters), visibility)
    )
    return picture
