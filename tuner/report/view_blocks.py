"""The images of a page: linear ones for its script, ready ones where none runs, and maps of the error."""

import base64
import io
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image

from vpltune.renderer.frame.passes.tone_mapping import EXPOSURE_KEY
from vpltune.tuner.evaluation.view_images import VARIANTS, ViewImages
from vpltune.tuner.metrics.error_maps import DIVERGING, MAGMA, map_png, signed_error
from vpltune.tuner.metrics.tone_curve import LUMINANCE, display_image
from vpltune.tuner.metrics.view_metrics import hdr_flip_map

SHOWN = ("reference", *VARIANTS)


@dataclass(frozen=True, eq=False)
class ViewBlock:
    """One view of a page."""

    index: int
    name: str
    split: str
    width: int
    height: int
    figures: dict[str, dict[str, Any]]
    """relMSE, energy ratio and FLIP by variant."""
    noise_floor: Any
    samples: Any
    images: dict[str, str]
    """data: addresses of `SHOWN`, exposed and tone-mapped."""
    signed_maps: dict[str, str]
    flip_maps: dict[str, str]
    linear: dict[str, Any]
    """What the script reads: sizes, exposures, and half floats by name, see `packed_halves`."""

    @property
    def weight(self) -> int:
        """Bytes that it adds to the page."""
        texts = (self.images, self.signed_maps, self.flip_maps, self.linear["halves"])
        return sum(len(text) for part in texts for text in part.values())


def view_block(images: ViewImages, measured: dict[str, Any]) -> ViewBlock:
    """Everything a page shows of one view. `measured` is its entry in `per_view`."""
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
    """A linear image as text: half floats, low bytes before high ones, plane by plane; zlib, base64.

    Bytes sorted like that weigh a quarter less than side by side.
    """
    halves = np.ascontiguousarray(image.astype("<f2"))
    planes = halves.view(np.uint8).reshape(*halves.shape, 2).transpose(3, 2, 0, 1)
    return base64.b64encode(zlib.compress(planes.tobytes(), 9)).decode("ascii")


def png_address(image: np.ndarray) -> str:
    """An 8-bit image as a data: address."""
    file = io.BytesIO()
    Image.fromarray(image).save(file, "PNG", optimize=True)
    return data_address(file.getvalue())


def data_address(png: bytes) -> str:
    """A PNG file as a data: address."""
    return f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"


def image_exposure(images: ViewImages) -> float:
    """What a whole image of the view is multiplied by before the tone curve, in every variant."""
    return _exposure(images.radiance("reference"), images.valid)


def _exposure(linear: np.ndarray, valid: np.ndarray) -> float:
    """What brings the mean luminance to the runtime's key."""
    level = float((linear[valid].astype(np.float64) @ LUMINANCE).mean()) if valid.any() else 0.0
    return EXPOSURE_KEY / level if level > 0.0 else 1.0
