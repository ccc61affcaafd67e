"""How far an image is from its reference: errors and energy of irradiance, HDR-FLIP of the light.

All but FLIP are relative to the reference: against a black one they are NaN, null in JSON.
"""

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass, fields
from statistics import fmean

# FLIP's threads spin while they wait for each other: on a busy machine two of them took ten times as long
# as one for images of this size. Read once, when its library is loaded.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import flip_evaluator
import numpy as np
from jaxtyping import Bool, Float, Float64

from vpltune.tuner.metrics.relative_squared_error import DARK_SHARE

WORST_SHARE = 0.001
"""Share of a view's pixels that the trimmed relMSE leaves out: the worst ones, rounded up to whole pixels."""


@dataclass(frozen=True)
class ViewMetrics:
    """The figures of one view, or the mean over several."""

    relmse: float
    """mean((y − r)²/(r² + 0.01·mean(r)²)) over valid pixels and channels; includes the reference's noise."""
    trimmed_relmse: float
    """relMSE without the worst `WORST_SHARE` of the pixels."""
    worst_share: float
    """Share of the relMSE that these worst pixels hold, in [0, 1]."""
    median_error: float
    """The relative error of the typical pixel: median of Σ_c|y − r|/Σ_c r over valid, lit pixels."""
    energy_ratio: float
    """mean(y)/mean(r) over valid pixels and channels."""
    flip: float
    """Mean HDR-FLIP (Andersson et al. 2021) of direct plus indirect radiance, in [0, 1]. Both images have the
    runtime's albedo, so that light is compared and texture filtering is not."""
    flicker: float = math.nan
    """What moving the lights by a texel changes (`tuner.metrics.flicker`); NaN where it was not measured."""

    def as_dict(self) -> dict[str, float]:
        """The figures by name; flicker only where it was measured."""
        figures = {each.name: getattr(self, each.name) for each in fields(self)}
        if math.isnan(self.flicker):
            del figures["flicker"]
        return figures


def relmse(image: Float[np.ndarray, "pixels 3"], reference: Float[np.ndarray, "pixels 3"]) -> float:
    """Relative mean squared error; NaN against a black reference."""
    errors = squared_errors(image, reference)
    return float(errors.mean()) if errors.size else math.nan


def trimmed_relmse(
    image: Float[np.ndarray, "pixels 3"], reference: Float[np.ndarray, "pixels 3"]
) -> tuple[float, float]:
    """relMSE without the worst `WORST_SHARE` of the pixels, and the share of it that those hold.

    One pixel is always kept. Both are NaN against a black reference, the share 0 where there is no error.
    """
    errors = np.sort(squared_errors(image, reference))
    if not errors.size:
        return math.nan, math.nan
    kept = errors[: max(1, len(errors) - math.ceil(WORST_SHARE * len(errors)))]
    total = float(errors.sum())
    return float(kept.mean()), 1.0 - float(kept.sum()) / total if total > 0.0 else 0.0


def squared_errors(
    image: Float[np.ndarray, "pixels 3"], reference: Float[np.ndarray, "pixels 3"]
) -> Float64[np.ndarray, " measured"]:
    """What each pixel adds to the relMSE, times their number; none against a black reference."""
    y, r = image.astype(np.float64), reference.astype(np.float64)
    denominator = r**2 + DARK_SHARE * r.mean() ** 2 if r.size else r
    return ((y - r) ** 2 / denominator).mean(axis=1) if denominator.any() else np.zeros(0)


def median_error(image: Float[np.ndarray, "pixels 3"], reference: Float[np.ndarray, "pixels 3"]) -> float:
    """The median relative error over the pixels that light reaches; NaN where it reaches none."""
    y, r = image.astype(np.float64), reference.astype(np.float64)
    level = r.sum(axis=1)
    lit = level > 0.0
    return float(np.median(np.abs(y - r).sum(axis=1)[lit] / level[lit])) if lit.any() else math.nan


def energy_ratio(image: Float[np.ndarray, "pixels 3"], reference: Float[np.ndarray, "pixels 3"]) -> float:
    """Mean of the image over mean of the reference; NaN against a black reference."""
    mean = float(reference.mean(dtype=np.float64)) if reference.size else 0.0
    return float(image.mean(dtype=np.float64)) / mean if mean > 0.0 else math.nan


def hdr_flip(
    image: Float[np.ndarray, "height width 3"], reference: Float[np.ndarray, "height width 3"]
) -> float:
    """Mean HDR-FLIP of two radiance images, its exposures chosen from the reference; 0 if both are black.

    FLIP's exposures follow from the reference's brightest and median luminance, so both images are first
    divided by the reference's mean: the result depends on neither light units nor scale.
    """
    return float(hdr_flip_map(image, reference).mean(dtype=np.float64))


def hdr_flip_map(
    image: Float[np.ndarray, "height width 3"], reference: Float[np.ndarray, "height width 3"]
) -> Float[np.ndarray, "height width"]:
    """HDR-FLIP of every pixel, in [0, 1]; see `hdr_flip`, its mean."""
    level = float(reference.mean(dtype=np.float64))
    if level <= 0.0:
        return np.full(image.shape[:2], 1.0 if image.any() else 0.0, np.float32)
    scaled = [np.ascontiguousarray(image / level, np.float32) for image in (reference, image)]
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
    """All figures of one view.

    Args:
        irradiance, reference_irradiance: indirect [W/m²].
        radiance, reference_radiance: of the whole image with one albedo [W/(m² sr)].
        valid: the pixels that count.
    """
    shown, real = irradiance[valid], reference_irradiance[valid]
    trimmed, worst_share = trimmed_relmse(shown, real)
    return ViewMetrics(
        relmse=relmse(shown, real),
        trimmed_relmse=trimmed,
        worst_share=worst_share,
        median_error=median_error(shown, real),
        energy_ratio=energy_ratio(shown, real),
        flip=hdr_flip(radiance, reference_radiance),
    )


def mean_metrics(metrics: list[ViewMetrics]) -> ViewMetrics:
    """The mean of each figure over the views that have it; NaN where none does."""
    return ViewMetrics(
        **{each.name: _mean(getattr(m, each.name) for m in metrics) for each in fields(ViewMetrics)}
    )


def _mean(values: Iterable[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return fmean(known) if known else math.nan
