"""Error maps: signed error of irradiance, and HDR-FLIP of the whole image.

Both are palette images with one byte per pixel before compression. Invalid pixels are transparent.
"""

import io

import numpy as np
from jaxtyping import Bool, Float, UInt8
from PIL import Image

from vpltune.renderer.files.srgb import LUMINANCE
from vpltune.tuner.metrics.relative_squared_error import DARK_SHARE

DIVERGING = (
    *("#053061", "#2166ac", "#4393c3", "#92c5de", "#d1e5f0", "#f7f7f7"),
    *("#fddbc7", "#f4a582", "#d6604d", "#b2182b", "#67001f"),
)
"""ColorBrewer RdBu (Brewer 2003), safe for colour-blind readers: blue is too dark, red too bright."""
MAGMA = (
    *("#000004", "#180f3d", "#440f76", "#721f81", "#9e2f7f"),
    *("#cd4071", "#f1605d", "#fd9668", "#feca8d", "#fcfdbf"),
)
"""Magma by van der Walt and Smith (2015), perceptually uniform in lightness; used by the authors of FLIP."""
_LEVELS = 255  # colours of the palette
_TRANSPARENT = 255  # the remaining palette index


def signed_error(
    irradiance: Float[np.ndarray, "height width 3"],
    reference: Float[np.ndarray, "height width 3"],
    valid: Bool[np.ndarray, "height width"],
) -> Float[np.ndarray, "height width"]:
    """Signed relative error of the luminance: (y − r)/√(r² + 0.01·mean(r)²), 0 for invalid pixels.

    −1 means black instead of lit, 1 about twice as bright as the reference. It is the signed root of the
    summand of relMSE (`tuner.metrics.view_metrics.relmse`). Against a black reference it is +∞ where y > 0.
    """
    y, r = irradiance.astype(np.float64) @ LUMINANCE, reference.astype(np.float64) @ LUMINANCE
    mean = float(r[valid].mean()) if valid.any() else 0.0
    scale = np.sqrt(r * r + DARK_SHARE * mean * mean)
    error = np.divide(y - r, scale, out=np.where(y > r, np.inf, 0.0), where=scale > 0.0)
    return np.where(valid, error, 0.0)


def map_png(
    values: Float[np.ndarray, "height width"],
    low: float,
    high: float,
    colours: tuple[str, ...],
    valid: Bool[np.ndarray, "height width"],
) -> bytes:
    """The bytes of a PNG file that shows `values`, clamped to [`low`, `high`], in interpolated `colours`."""
    share = (np.clip(values, low, high) - low) / (high - low)
    indices = np.round(share * (_LEVELS - 1)).astype(np.uint8)
    image = Image.fromarray(np.where(valid, indices, np.uint8(_TRANSPARENT)))
    image.putpalette(_palette(colours))
    file = io.BytesIO()
    image.save(file, "PNG", transparency=_TRANSPARENT, optimize=True)
    return file.getvalue()


def map_pixels(
    values: Float[np.ndarray, "height width"],
    low: float,
    high: float,
    colours: tuple[str, ...],
    valid: Bool[np.ndarray, "height width"],
) -> UInt8[np.ndarray, "height width 3"]:
    """The pixels of `map_png`, sRGB, with invalid pixels white."""
    image = Image.open(io.BytesIO(map_png(values, low, high, colours, valid))).convert("RGBA")
    return np.asarray(Image.alpha_composite(Image.new("RGBA", image.size, "white"), image).convert("RGB"))


def _palette(colours: tuple[str, ...]) -> list[int]:
    stops = np.array([[int(colour[i : i + 2], 16) for i in (1, 3, 5)] for colour in colours], float)
    places = np.linspace(0.0, len(stops) - 1.0, _LEVELS)
    channels = [np.interp(places, np.arange(len(stops)), stops[:, channel]) for channel in range(3)]
    return [*np.round(np.stack(channels, axis=1)).astype(int).ravel().tolist(), 0, 0, 0]
