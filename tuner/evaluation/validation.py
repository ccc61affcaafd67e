"""Draws candidates in validation views and measures them; `tuner.evaluation.guard` judges by the result."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float32

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS, ArtistParameters, placement
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.views import View
from vpltune.tuner.fitting.search_space import SearchSpace
from vpltune.tuner.metrics.flicker import flicker, moved_by_a_texel
from vpltune.tuner.metrics.view_metrics import ViewMetrics, mean_metrics
from vpltune.tuner.reference.reference_view import ReferenceView
from vpltune.tuner.surrogate.captured_view import CapturedView

FITTED_SPACE = SearchSpace(tuple(spec for spec in ARTIST_PARAMETERS if spec.fitted))
"""The unit cube of all fitted parameters."""


def between(first: ArtistParameters, second: ArtistParameters, share: float) -> ArtistParameters:
    """Interpolate in the unit cube of the fitted parameters: `first` at a share of 0, `second` at 1.

    Parameters that are not fitted are those of `second`.
    """
    start, end = (FITTED_SPACE.point(each) for each in (first, second))
    return FITTED_SPACE.parameters(start + share * (end - start), second)


def candidates(
    start: ArtistParameters,
    base: ArtistParameters,
    tuned: ArtistParameters,
    auto: ArtistParameters | None,
) -> dict[str, ArtistParameters]:
    """The candidates that validation compares with the start, the simplest first.

    No two of them are equal, and none equals the start.

    Args:
        start: parameters that the fit started from.
        base: the tuned placement with the falloff and visibility that its fit started from.
        tuned: the fitted parameters.
        auto: the parameters that the learnt prior sets; None if it does not apply.
    """
    named = {"placement": base, "halfway": between(base, tuned, 0.5), "tuned": tuned}
    if base == tuned:
        # Halfway would differ from both by rounding only.
        named = {"placement": base}
    if auto is not None:
        named["auto"] = auto
    chosen: dict[str, ArtistParameters] = {}
    for name, parameters in named.items():
        if parameters != start and parameters not in chosen.values():
            chosen[name] = parameters
    return chosen


def validation_metrics(
    runtime: Runtime,
    views: Sequence[tuple[View, ReferenceView]],
    configs: Mapping[str, TunedConfig],
    rotations: Sequence[tuple[float, float]],
    *,
    motion: bool = False,
    progress: Callable[[float], None] | None = None,
) -> tuple[dict[str, list[ViewMetrics]], tuple[CapturedView, ...]]:
    """Measure every candidate in every lit view, averaged over rotations of the point table.

    Args:
        runtime: draws the views' scene.
        views: with their references.
        configs: candidates by name, without a prior. Those with equal placement share VPLs and maps.
        rotations: rotations of the point table, at least one.
        motion: whether to measure flicker too, which draws everything twice.
        progress: called with the share done, in [0, 1].

    Returns:
        Metrics of the lit views by candidate, and all views as captured with the first config, without maps.

    Raises:
        MachineError: the GPU ran out of memory or reported an error.
    """
    groups: dict[tuple, list[str]] = {}
    for name, each in configs.items():
        groups.setdefault(placement(each.parameters), []).append(name)
    measured: dict[str, list[ViewMetrics]] = {name: [] for name in configs}
    captured_views = []
    for index, (view, reference) in enumerate(views):
        drawn: dict[str, list[ViewMetrics]] = {name: [] for name in configs}
        for names in groups.values():
            for rotation in rotations:
                variants = [configs[name] for name in names]
                frame, images = runtime.capture_variants(view, variants, rotation)
                captured = CapturedView(view, reference, frame)
                if len(captured_views) == index:
                    captured_views.append(captured)
                if not captured.lit:
                    break
                moved: Sequence[Float32[np.ndarray, "height width 3"] | None] = [None] * len(images)
                if motion:
                    beside = moved_by_a_texel(view, frame.scene_length)
                    _, moved = runtime.capture_variants(beside, variants, rotation)
                for name, image, after in zip(names, images, moved, strict=True):
                    metrics = captured.metrics(image)
                    if after is not None:
                        metrics = replace(metrics, flicker=flicker(image, after, captured.valid))
                    drawn[name].append(metrics)
        if captured_views[-1].lit:
            for name, of_rotations in drawn.items():
                # `mean_metrics` skips NaN, but the guard must see it: pass that rotation on.
                broken = [each for each in of_rotations if not math.isfinite(each.relmse)]
                measured[name].append(broken[0] if broken else mean_metrics(of_rotations))
        if progress is not None:
            progress((index + 1) / len(views))
    return measured, tuple(captured_views)
