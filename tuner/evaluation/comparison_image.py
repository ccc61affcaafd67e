"""comparison.png: reference, default, tuned and ceiling as whole images, indirect light and signed error."""

import math
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float32, UInt8
from PIL import Image, ImageDraw, ImageFont

from vpltune.renderer.files.srgb import LUMINANCE
from vpltune.renderer.frame.passes.tone_mapping import EXPOSURE_KEY
from vpltune.renderer.frame.runtime import Runtime
from vpltune.tuner.evaluation.evaluate import VARIANTS, EvaluatedView
from vpltune.tuner.metrics.error_maps import DIVERGING, map_pixels, signed_error
from vpltune.tuner.metrics.view_metrics import ViewMetrics
from vpltune.tuner.surrogate.captured_view import CapturedView

PANEL_WIDTH, PANEL_HEIGHT = 320, 240
"""Least size of a panel, in pixels. A choice."""
_MARGIN = 8
"""Pixels around a panel. A choice."""
_CAPTION = 22
"""Height of the caption above a panel, in pixels. A choice that fits the largest font."""
_FONT_SIZES = range(14, 7, -1)
"""In pixels: the largest in which a caption is no wider than its panel. A choice."""

Irradiance = Float32[np.ndarray, "height width 3"]
Image8 = UInt8[np.ndarray, "height width 3"]
Pixels = UInt8[np.ndarray, "rows columns 3"]


def comparison_image(runtime: Runtime, views: tuple[tuple[str, EvaluatedView], ...]) -> Pixels:
    """Three rows of panels for each view: whole images, indirect light and signed error; sRGB.

    Where tuned draws what default does, one panel stands for both. Pixels are repeated, never blended, until
    a panel has at least `PANEL_WIDTH` × `PANEL_HEIGHT` of them.

    Args:
        runtime: maps radiance to display colours.
        views: each with the reason that it is shown for.
    """
    rows = [row for shown_for, view in views for row in _rows(runtime, view, shown_for)]
    width = max(row.shape[1] for row in rows)
    rows = [np.pad(row, ((0, 0), (0, width - row.shape[1]), (0, 0)), constant_values=255) for row in rows]
    return np.concatenate(rows)


def image_row(
    runtime: Runtime, view: CapturedView, irradiance: Mapping[str, Irradiance], panel_height: int
) -> Pixels:
    """One row of panels: the reference, then an image for each indirect irradiance [W/m²], by caption.

    All have the reference's exposure. Pixels are repeated until a panel has `panel_height` of them.
    """
    reference = view.reference_radiance()
    exposure = _exposure(reference, view)
    size = (1, panel_height)
    panels = [_panel(runtime.display(reference, exposure), f"{view.view.name}: reference", size)]
    for caption, image in irradiance.items():
        panels.append(_panel(runtime.display(view.runtime_radiance(image), exposure), caption, size))
    return np.concatenate(panels, axis=1)


def captioned(name: str, metrics: ViewMetrics) -> str:
    """Caption of a panel: the variant's name and its errors."""
    if math.isnan(metrics.relmse):
        return f"{name}: no indirect light to compare with"
    return f"{name}: relMSE {metrics.relmse:.3g}, energy {metrics.energy_ratio:.2f}, FLIP {metrics.flip:.3f}"


def _rows(runtime: Runtime, evaluated: EvaluatedView, shown_for: str) -> list[Pixels]:
    view, size = evaluated.view, (PANEL_WIDTH, PANEL_HEIGHT)
    reference = view.reference_radiance()
    exposure = _exposure(reference, view)
    whole = [_panel(runtime.display(reference, exposure), f"{view.view.name} ({shown_for}): reference", size)]
    light = view.reference.irradiance * view.valid[..., None]
    light_exposure = _exposure(light, view)
    indirect = [_panel(runtime.display(light, light_exposure), "indirect light: reference", size)]
    blank = np.full((*view.valid.shape, 3), 255, np.uint8)
    errors = [_panel(blank, "signed error: blue too dark, red too bright", size)]
    captions = {name: name for name in VARIANTS}
    if not evaluated.changed:
        captions = {"tuned": "tuned = default", "ceiling": "ceiling"}
    for name, caption in captions.items():
        image = evaluated.irradiance[name]
        shown = runtime.display(view.runtime_radiance(image), exposure)
        whole.append(_panel(shown, captioned(caption, evaluated.metrics[name]), size))
        shown = runtime.display(image * view.valid[..., None], light_exposure)
        indirect.append(_panel(shown, f"indirect light: {caption}", size))
        signed = signed_error(image, view.reference.irradiance, view.valid)
        colors = map_pixels(signed, -1.0, 1.0, DIVERGING, view.valid)
        errors.append(_panel(colors, f"signed error: {caption}", size))
    return [np.concatenate(panels, axis=1) for panels in (whole, indirect, errors)]


def _exposure(radiance: Irradiance, view: CapturedView) -> float:
    """The exposure that brings the mean luminance to `EXPOSURE_KEY`; 1 for a black image."""
    level = float((radiance[view.valid] @ LUMINANCE.astype(np.float32)).mean()) if view.valid.any() else 0.0
    return EXPOSURE_KEY / level if level > 0.0 else 1.0


def _panel(image: Image8, caption: str, size: tuple[int, int]) -> Pixels:
    factor = max(-(-size[0] // image.shape[1]), -(-size[1] // image.shape[0]))
    image = image.repeat(factor, axis=0).repeat(factor, axis=1)
    height, width, _ = image.shape
    panel = Image.new("RGB", (width + 2 * _MARGIN, height + _CAPTION + _MARGIN), "white")
    panel.paste(Image.fromarray(image), (_MARGIN, _CAPTION))
    drawing = ImageDraw.Draw(panel)
    fonts = [ImageFont.load_default(size) for size in _FONT_SIZES]
    font = next((each for each in fonts if drawing.textlength(caption, each) <= width), fonts[-1])
    drawing.text((_MARGIN, 3), caption, fill="black", font=font)
    return np.asarray(panel)
