"""How far a picture is from its reference: relMSE and energy of irradiance, HDR-FLIP of radiance.

relMSE and energy ratio are relative to the reference's mean: against a black one they are NaN, null in JSON.
"""

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass
from statistics import fmean

# FLIP's threads spin while they wait for each other: on a busy machine two of them took ten times as long
# as one for pictures of this size. Read once, when its library is loaded.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import flip_evaluator
import numpy as np
from jaxtyping import Bool, Float

from tuner.losses.relative_squared_error import DARK_SHARE


@dataclass(frozen=True)
class ViewMetrics:
    """Of one view, or the mean over several."""

    relmse: float
    """mean((y − r)²/(r² + 0.01·mean(r)²)) over valid pixels and channels; holds the reference's noise."""
    energy_ratio: float
    """mean(y)/mean(r) over valid pixels and channels."""
    flip: float
    """Mean HDR-FLIP (Andersson et al. 2021) of direct plus indirect radiance, in [0, 1]."""


def relmse(picture: Float[np.ndarray, "pixels 3"], reference: Float[np.ndarray, "pixels 3"]) -> float:
    """Relative mean squared error; NaN against a black reference."""
    y, r = picture.astype(np.float64), reference.astype(np.float64)
    denominator = r**2 + DARK_SHARE * r.mean() ** 2 if r.size else r
    if not denominator.any():
        return math.nan
    return float(np.mean((y - r) ** 2 / denominator))


def energy_ratio(picture: Float[np.ndarray, "pixels 3"], reference: Float[np.ndarray, "pixels 3"]) -> float:
    """Mean of the picture over mean of the reference; NaN against a black reference."""
    mean = float(reference.mean(dtype=np.float64)) if reference.size else 0.0
    return float(picture.mean(dtype=np.float64)) / mean if mean > 0.0 else math.nan


def hdr_flip(
    picture: Float[np.ndarray, "height width 3"], reference: Float[np.ndarray, "height width 3"]
) -> float:
    """Mean HDR-FLIP of two radiance pictures, its exposures chosen from the reference; 0 if both are black.

    FLIP's exposures follow from the reference's brightest and median luminance, so both pictures are first
    divided by the reference's mean: the result depends on neither light units nor scale.
    """
    return float(hdr_flip_map(picture, reference).mean(dtype=np.float64))


def hdr_flip_map(
    picture: Float[np.ndarray, "height width 3"], reference: Float[np.ndarray, "height width 3"]
) -> Float[np.ndarray, "height width"]:
    """HDR-FLIP of every pixel, in [0, 1]; see `hdr_flip`, its mean."""
    level = float(reference.mean(dtype=np.float64))
    if level <= 0.0:
        return np.full(picture.shape[:2], 1.0 if picture.any() else 0.0, np.float32)
    scaled = [np.ascontiguousarray(image / level, np.float32) for image in (reference, picture)]
    with np.errstate(all="ignore"):
        errors, _, _ = flip_evaluator.evaluate(scaled[0], scaled[1], "HDR", applyMagma=False)
    return errors[..., 0]


def view_metrics(
    irradiance: Float[np.ndarray, "height width 3"],
    reference_irradiance: Float[np.ndarray, "height width 3"],
    radiance: Float[np.ndarray, "height width 3"],
    reference_radiance: Float[np.ndarray, "height width 3"],
    valid: Bool[np.ndarray, "height width"],
) -> ViewMetrics:
    """All three figures of one view. Irradiance is that of one bounce, in W/m²; radiance is the whole
    picture's, in W/(m² sr)."""
    return ViewMetrics(
        relmse=relmse(irradiance[valid], reference_irradiance[valid]),
        energy_ratio=energy_ratio(irradiance[valid], reference_irradiance[valid]),
        flip=hdr_flip(radiance, reference_radiance),
    )


def mean_metrics(metrics: list[ViewMetrics]) -> ViewMetrics:
    """The mean of each figure over the views that have it; NaN where none does."""
    return ViewMetrics(
        relmse=_mean(m.relmse for m in metrics),
        energy_ratio=_mean(m.energy_ratio for m in metrics),
        flip=_mean(m.flip for m in metrics),
    )


def _mean(values: Iterable[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return fmean(known) if known else math.nan
