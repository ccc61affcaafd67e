"""The images of a page: linear for its script, tone-mapped for when no script runs, and error maps."""

import base64
import io
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image

from vpltune.renderer.files.srgb import LUMINANCE
from vpltune.renderer.frame.passes.tone_mapping import EXPOSURE_KEY
from vpltune.tuner.evaluation.view_images import VARIANTS, ViewImages
from vpltune.tuner.metrics.error_maps import DIVERGING, MAGMA, map_png, signed_error
from vpltune.tuner.metrics.tone_curve import display_image
from vpltune.tuner.metrics.view_metrics import hdr_flip_map

SHOWN = ("reference", *VARIANTS)
"""The images of each view; scene.js lists the same names."""


@dataclass(frozen=True, eq=False)
class ViewBlock:
    """One view of a page."""

    index: int
    name: str
    split: str
    """`fitted` or `held_out`; empty if unknown."""
    width: int
    height: int
    figures: dict[str, dict[str, Any]]
    """Figures by variant and name."""
    noise_floor: Any
    samples: Any
    images: dict[str, str]
    """data: URL of each image of `SHOWN`, exposed and tone-mapped."""
    signed_maps: dict[str, str]
    """data: URL of each variant's map of the signed error."""
    flip_maps: dict[str, str]
    """data: URL of each variant's map of HDR-FLIP."""
    linear: dict[str, Any]
    """Data for the script: size, exposures, and linear images as `packed_halves`."""

    @property
    def weight(self) -> int:
        """Bytes that the images add to the page."""
        texts = (self.images, self.signed_maps, self.flip_maps, self.linear["halves"])
        return sum(len(text) for part in texts for text in part.values())


def view_block(images: ViewImages, measured: dict[str, Any]) -> ViewBlock:
    """Everything that a page shows of one view. `measured` is its entry of `per_view` in metrics.json."""
    valid = images.valid
    exposures = {
        "image": image_exposure(images),
        "irradiance": _exposure(images.indirect["reference"], valid),
    }
    signed = {
        name: signed_error(images.indirect[name], images.indirect["reference"], valid) for name in VARIANTS
    }
    light = images.light("reference")
    flip = {name: hdr_flip_map(images.light(name), light) for name in VARIANTS}
    everywhere = np.ones_like(valid)
    height, width = valid.shape
    return ViewBlock(
        index=images.index,
        name=str(measured.get("name", f"view {images.index}")),
        split=str(measured.get("split", "")),
        width=width,
        height=height,
        figures={name: measured[name] for name in VARIANTS if isinstance(measured.get(name), dict)},
        noise_floor=measured.get("noise_floor"),
        samples=measured.get("samples"),
        images={
            name: png_address(display_image(images.radiance(name), exposures["image"])) for name in SHOWN
        },
        signed_maps={
            name: data_address(map_png(signed[name], -1.0, 1.0, DIVERGING, valid)) for name in VARIANTS
        },
        flip_maps={name: data_address(map_png(flip[name], 0.0, 1.0, MAGMA, everywhere)) for name in VARIANTS},
        linear={
            "width": width,
            "height": height,
            "level": images.level,
            "exposures": exposures,
            "halves": {name: packed_halves(image) for name, image in _linear(images).items()},
        },
    )


def _linear(images: ViewImages) -> dict[str, np.ndarray]:
    return {
        "reference_albedo": images.reference_albedo,
        "reference_direct": images.reference_direct,
        "albedo": images.albedo,
        "direct": images.direct,
        **{f"{name}_indirect": images.indirect[name] for name in SHOWN},
    }


def packed_halves(image: np.ndarray) -> str:
    """Encode a linear image [height, width, 3] as text: half floats, split into planes, zlib, base64.

    The planes are the low bytes of each channel, then the high bytes of each channel. In this order the text
    is a quarter shorter than with interleaved bytes.
    """
    halves = np.ascontiguousarray(image.astype("<f2"))
    planes = halves.view(np.uint8).reshape(*halves.shape, 2).transpose(3, 2, 0, 1)
    return base64.b64encode(zlib.compress(planes.tobytes(), 9)).decode("ascii")


def png_address(image: np.ndarray) -> str:
    """An 8-bit image as a data: URL of a PNG file."""
    file = io.BytesIO()
    Image.fromarray(image).save(file, "PNG", optimize=True)
    return data_address(file.getvalue())


def data_address(png: bytes) -> str:
    """The bytes of a PNG file as a data: URL."""
    return f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"


def image_exposure(images: ViewImages) -> float:
    """The exposure of whole images of a view, the same for all variants: the factor before the tone curve."""
    return _exposure(images.radiance("reference"), images.valid)


def _exposure(linear: np.ndarray, valid: np.ndarray) -> float:
    """The factor that brings the mean luminance to `EXPOSURE_KEY`, as in the runtime; 1 for a black image."""
    level = float((linear[valid].astype(np.float64) @ LUMINANCE).mean()) if valid.any() else 0.0
    return EXPOSURE_KEY / level if level > 0.0 else 1.0
