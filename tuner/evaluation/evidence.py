"""Whether the views of a scene, and their references, serve to judge a fit by: each doubt is one sentence."""

from collections.abc import Sequence
from statistics import fmean

import numpy as np

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.fitting.uncertainty import Interval
from vpltune.tuner.reference.reference_view import noise_floor
from vpltune.tuner.surrogate.captured_view import CapturedView

LEAST_LIT_VIEWS = 2
"""Validation views that light must reach: a spread needs two."""
LEAST_PIXELS = 256
"""Lit pixels that the validation views must have together. A choice: a twelfth of one default view."""
CLOSE = 0.03
"""Share of L. A camera with a smaller median depth stands against a surface, or sees little of what is
lit."""
MOST_DISAGREEMENT = 0.1
"""Share of the pixels at which runtime and reference may see two surfaces. A choice: edges make up some 2
%, a camera inside a surface that the near plane cuts away most of an image."""
MOST_NOISE = 0.01
"""relMSE of the reference's own noise: ten times what references are rendered to."""


def doubts(fitted: Sequence[CapturedView], validation: Sequence[CapturedView]) -> tuple[str, ...]:
    """What speaks against judging by these views; none where they serve.

    Args:
        fitted, validation: captured views; `fitted` has one that light reaches.
    """
    found = []
    views = (*fitted, *validation)
    lit = [view for view in validation if view.lit]
    if len(lit) < LEAST_LIT_VIEWS:
        found.append(f"indirect light reaches only {len(lit)} of {len(validation)} validation views")
    pixels = sum(int(view.reference.irradiance[view.valid].any(axis=-1).sum()) for view in validation)
    if pixels < LEAST_PIXELS:
        found.append(
            f"the validation views have only {pixels} lit pixels, {LEAST_PIXELS} are needed to judge by"
        )
    close = [view for view in views if _is_close(view)]
    if 2 * len(close) > len(views) or (fitted and _is_close(fitted[0])):
        view = close[0]
        found.append(
            f"the camera stands against a surface, or sees little of what is lit: {view.view.name} looks "
            f"{_median_depth(view):.3g} deep, where light is spread over {view.captured.scene_length:.3g}"
        )
    apart = max(views, key=lambda view: view.disagreement)
    if fmean(view.disagreement for view in views) > MOST_DISAGREEMENT:
        found.append(
            f"runtime and reference see different surfaces at {apart.disagreement:.0%} of the pixels of "
            f"{apart.view.name}: a camera inside a surface, or surfaces on top of each other"
        )
    noise = (
        fmean(noise_floor(view.reference) for view in views if view.lit) if any(v.lit for v in views) else 0.0
    )
    if noise > MOST_NOISE:
        found.append(
            f"the references are too noisy to judge by: their noise alone is a relMSE of {noise:.2g}"
        )
    return tuple(found)


def undetermined(known: dict[str, Interval], written: ArtistParameters) -> tuple[str, ...]:
    """A sentence for each fitted parameter that the views leave open, or that ran to a bound of its range.

    Args:
        known: what the fit knows of each parameter.
        written: what the fit ends with.
    """
    found = []
    for name, interval in known.items():
        if interval.determined:
            continue
        if interval.at_bound is not None:
            why = f"it ran to the bound {interval.at_bound:g} of its range"
        else:
            why = f"its interval is {interval.low:.3g} to {interval.high:.3g}"
        value = getattr(written, name)
        found.append(f"{name} is not determined by these views: {why}; {value:.4g} is written")
    return tuple(found)


def _is_close(view: CapturedView) -> bool:
    return 0.0 < _median_depth(view) < CLOSE * view.captured.scene_length


def _median_depth(view: CapturedView) -> float:
    depth = view.captured.depth[view.captured.valid]
    return float(np.median(depth)) if depth.size else 0.0
