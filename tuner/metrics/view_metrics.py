"""Error metrics of an image against its reference: errors and energy of irradiance, HDR-FLIP of radiance.

All metrics but FLIP are relative to the reference. Against a black reference they are NaN, which is null in
JSON.
"""

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass, fields
from statistics import fmean

# FLIP's threads busy-wait for each other: on a loaded machine, two took ten times as long as one for images
# of this size. The variable is read once, when the library is loaded.
os.environ.setdefault("OMP_NUM_THREADS", "1")

import flip_evaluator
import numpy as np
from jaxtyping import Bool, Float, Float64

from vpltune.tuner.metrics.relative_squared_error import DARK_SHARE

WORST_SHARE = 0.001
"""Share of the pixels, the worst, that trimmed relMSE leaves out; rounded up to whole pixels. A choice."""


@dataclass(frozen=True)
class ViewMetrics:
    """The metrics of one view, or their mean over several views."""

    relmse: float
    """mean((y − r)²/(r² + 0.01·mean(r)²)) over valid pixels and channels; includes reference noise."""
    trimmed_relmse: float
    """relMSE without the worst `WORST_SHARE` of the pixels."""
    worst_share: float
    """Share of the relMSE that is in these worst pixels, in [0, 1]."""
    median_error: float
    """Median over valid, lit pixels of the relative error Σ_c|y − r| ÷ Σ_c r."""
    energy_ratio: float
    """mean(y)/mean(r) over valid pixels and channels."""
    flip: float
    """Mean HDR-FLIP (Andersson et al. 2021) of direct plus indirect radiance, in [0, 1]. Both images have the
    runtime's albedo, so that it compares light and not texture filtering."""
    flicker: float = math.nan
    """Change when the lights move by a texel (`tuner.metrics.flicker`); NaN if it was not measured."""

    def as_dict(self) -> dict[str, float]:
        """The metrics by name; flicker only if it was measured."""
        figures = {each.name: getattr(self, each.name) for each in fields(self)}
        if math.isnan(self.flicker):
            del figures["flicker"]
        return figures


def relmse(image: Float[np.ndarray, "pixels 3"], reference: Float[np.ndarray, "pixels 3"]) -> float:
    """Relative mean squared error, see `ViewMetrics.relmse`; NaN against a black reference."""
    errors = squared_errors(image, reference)
    return float(errors.mean()) if errors.size else math.nan


def trimmed_relmse(
    image: Float[np.ndarray, "pixels 3"], reference: Float[np.ndarray, "pixels 3"]
) -> tuple[float, float]:
    """relMSE without the worst `WORST_SHARE` of the pixels, and the share of the relMSE in those pixels.

    At least one pixel is kept. Both are NaN against a black reference. Without any error the share is 0.
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
    """Squared relative error of each pixel, whose mean is the relMSE; empty against a black reference."""
    y, r = image.astype(np.float64), reference.astype(np.float64)
    denominator = r**2 + DARK_SHARE * r.mean() ** 2 if r.size else r
    return ((y - r) ** 2 / denominator).mean(axis=1) if denominator.any() else np.zeros(0)


def median_error(image: Float[np.ndarray, "pixels 3"], reference: Float[np.ndarray, "pixels 3"]) -> float:
    """Median relative error over the lit pixels, see `ViewMetrics.median_error`; NaN if none is lit."""
    y, r = image.astype(np.float64), reference.astype(np.float64)
    level = r.sum(axis=1)
    lit = level > 0.0
    return float(np.median(np.abs(y - r).sum(axis=1)[lit] / level[lit])) if lit.any() else math.nan


def energy_ratio(image: Float[np.ndarray, "pixels 3"], reference: Float[np.ndarray, "pixels 3"]) -> float:
    """Mean of the image ÷ mean of the reference; NaN against a black reference."""
    mean = float(reference.mean(dtype=np.float64)) if reference.size else 0.0
    return float(image.mean(dtype=np.float64)) / mean if mean > 0.0 else math.nan


def hdr_flip(
    image: Float[np.ndarray, "height width 3"], reference: Float[np.ndarray, "height width 3"]
) -> float:
    """Mean HDR-FLIP of two radiance images, in [0, 1]; 0 if both are black, 1 if only the reference is.

    FLIP takes its exposures from the maximum and median luminance of the reference. Both images are divided
    by the mean of the reference first, so the result does not depend on the units or scale of the light.
    """
    return float(hdr_flip_map(image, reference).mean(dtype=np.float64))


def hdr_flip_map(
    image: Float[np.ndarray, "height width 3"], reference: Float[np.ndarray, "height width 3"]
) -> Float[np.ndarray, "height width"]:
    """HDR-FLIP of each pixel, in [0, 1]. `hdr_flip` is its mean."""
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
    """All metrics of one view except flicker.

    Args:
        irradiance: Indirect irradiance [W/m²].
        reference_irradiance: Indirect irradiance of the reference [W/m²].
        radiance: Radiance of the whole image [W/(m²·sr)].
        reference_radiance: Radiance of the whole reference, with the albedo of `radiance` [W/(m²·sr)].
        valid: Pixels to compare. FLIP compares all pixels.
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
    """Mean of each metric over the views where it is not NaN; NaN if there are none."""
    return ViewMetrics(
        **{each.name: _mean(getattr(m, each.name) for m in metrics) for each in fields(ViewMetrics)}
    )


def _mean(values: Iterable[float]) -> float:
    known = [value for value in values if not math.isnan(value)]
    return fmean(known) if known else math.nan
