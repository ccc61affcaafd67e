"""Side by side: the reference, default, tuned and ceiling, under one exposure for each row."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from jaxtyping import Float32, UInt8
from PIL import Image, ImageDraw, ImageFont

from renderer.image_file import write_png
from renderer.passes.tone_mapping import EXPOSURE_KEY
from renderer.runtime import Runtime
from tuner.captured_view import CapturedView
from tuner.evaluate import VARIANTS, EvaluatedView
from tuner.view_metrics import ViewMetrics

_MARGIN = 8
_CAPTION = 22
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


def write_comparison(
    path: Path, runtime: Runtime, views: tuple[EvaluatedView, ...], panel_height: int
) -> None:
    """Write one row for each view: reference, default, tuned, ceiling.

    Pixels are repeated, never blended, until a panel is at least `panel_height` high.

    Raises:
        InputError: the path cannot be written to.
    """
    rows = [_row(runtime, view, panel_height) for view in views]
    width = max(row.shape[1] for row in rows)
    rows = [np.pad(row, ((0, 0), (0, width - row.shape[1]), (0, 0)), constant_values=255) for row in rows]
    write_png(path, np.concatenate(rows))


def picture_row(
    runtime: Runtime,
    view: CapturedView,
    irradiance: Mapping[str, Float32[np.ndarray, "height width 3"]],
    panel_height: int,
) -> UInt8[np.ndarray, "rows columns 3"]:
    """The reference, and beside it pictures of the same view with other indirect irradiance, by caption."""
    reference = view.reference_radiance()
    level = float((reference[view.valid] @ _LUMINANCE).mean()) if view.valid.any() else 0.0
    exposure = EXPOSURE_KEY / level if level > 0.0 else 1.0
    panels = [_panel(runtime, reference, exposure, panel_height, f"{view.view.name}: reference")]
    for caption, picture in irradiance.items():
        panels.append(_panel(runtime, view.runtime_radiance(picture), exposure, panel_height, caption))
    return np.concatenate(panels, axis=1)


def captioned(name: str, metrics: ViewMetrics) -> str:
    """A panel's caption: whose picture it is, and how far from the reference."""
    if math.isnan(metrics.relmse):
        return f"{name}: no indirect light to compare with"
    return f"{name}: relMSE {metrics.relmse:.3g}, energy {metrics.energy_ratio:.2f}"


def _row(runtime: Runtime, evaluated: EvaluatedView, panel_height: int) -> np.ndarray:
    pictures = {
        captioned(variant, evaluated.metrics[variant]): evaluated.irradiance[variant] for variant in VARIANTS
    }
    return picture_row(runtime, evaluated.view, pictures, panel_height)


def _panel(
    runtime: Runtime, radiance: np.ndarray, exposure: float, panel_height: int, caption: str
) -> np.ndarray:
    factor = -(-panel_height // radiance.shape[0])
    picture = runtime.display(radiance, exposure).repeat(factor, axis=0).repeat(factor, axis=1)
    height, width, _ = picture.shape
    panel = Image.new("RGB", (width + 2 * _MARGIN, height + _CAPTION + _MARGIN), "white")
    panel.paste(Image.fromarray(picture), (_MARGIN, _CAPTION))
    ImageDraw.Draw(panel).text((_MARGIN, 3), caption, fill="black", font=ImageFont.load_default(14))
    return np.asarray(panel)
