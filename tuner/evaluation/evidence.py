"""Checks whether the views of a scene and their references can be used to judge a fit."""

from collections.abc import Sequence
from statistics import fmean

import numpy as np

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.tuner.fitting.uncertainty import Interval
from vpltune.tuner.reference.reference_view import noise_floor
from vpltune.tuner.surrogate.captured_view import CapturedView

LEAST_LIT_VIEWS = 2
"""Least number of lit validation views: the spread between views needs two."""
LEAST_PIXELS = 256
"""Least number of lit pixels in all validation views together. A choice: a twelfth of one default view."""
CLOSE = 0.03
"""Share of L. A camera with a smaller median depth is too close to a surface, or sees little of what is lit.
A choice."""
MOST_DISAGREEMENT = 0.1
"""Share of the pixels at which runtime and reference may see different surfaces. A choice: edges make up
about 2 %; a camera inside a surface that the near plane cuts away makes most of an image differ."""
MOST_NOISE = 0.01
"""Largest mean relMSE by the references' own noise. A choice: twenty times what they are rendered to
(`tuner.evaluation.prepare_scene.NOISE_TARGET`)."""


def doubts(fitted: Sequence[CapturedView], validation: Sequence[CapturedView]) -> tuple[str, ...]:
    """Reasons not to judge a fit by these views, one sentence each; empty if there are none.

    Args:
        fitted: captured views, at least one of them lit.
        validation: captured views.
    """
    found = []
    views = (*fitted, *validation)
    lit = [view for view in validation if view.lit]
    if len(lit) < LEAST_LIT_VIEWS:
        found.append(f"indirect light reaches only {len(lit)} of {len(validation)} validation views")
    pixels = sum(int(view.reference.irradiance[view.valid].any(axis=-1).sum()) for view in validation)
    if pixels < LEAST_PIXELS:
        found.append(
            f"the validation views have only {pixels} lit pixels; at least {LEAST_PIXELS} are needed"
        )
    close = [view for view in views if _is_close(view)]
    if 2 * len(close) > len(views) or (fitted and _is_close(fitted[0])):
        view = close[0]
        found.append(
            f"the camera is too close to a surface or sees little of what is lit: the median depth of "
            f"{view.view.name} is {_median_depth(view):.3g}, and light spreads over "
            f"{view.captured.scene_length:.3g}"
        )
    apart = max(views, key=lambda view: view.disagreement)
    if fmean(view.disagreement for view in views) > MOST_DISAGREEMENT:
        found.append(
            f"runtime and reference see different surfaces at {apart.disagreement:.0%} of the pixels of "
            f"{apart.view.name}: the camera is inside a surface, or surfaces coincide"
        )
    noise = (
        fmean(noise_floor(view.reference) for view in views if view.lit) if any(v.lit for v in views) else 0.0
    )
    if noise > MOST_NOISE:
        found.append(f"the references are too noisy: their noise alone is a relMSE of {noise:.2g}")
    return tuple(found)


def undetermined(known: dict[str, Interval], written: ArtistParameters) -> tuple[str, ...]:
    """A sentence for each fitted parameter that the views do not determine.

    Args:
        known: the interval of each fitted parameter, by name.
        written: the parameters that the config will have.
    """
    found = []
    for name, interval in known.items():
        if interval.determined:
            continue
        if interval.at_bound is not None:
            why = f"the fit ran to its bound {interval.at_bound:g}"
        else:
            why = f"its interval is {interval.low:.3g} to {interval.high:.3g}"
        value = getattr(written, name)
        found.append(f"{name} is not determined by these views: {why}; the config has {value:.4g}")
    return tuple(found)


def _is_close(view: CapturedView) -> bool:
    return 0.0 < _median_depth(view) < CLOSE * view.captured.scene_length


def _median_depth(view: CapturedView) -> float:
    depth = view.captured.depth[view.captured.valid]
    return float(np.median(depth)) if depth.size else 0.0
