"""The pictures of a page: linear ones for its script, ready ones where none runs, and maps of the error."""

import base64
import io
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image

from vpltune.renderer.frame.passes.tone_mapping import EXPOSURE_KEY
from vpltune.tuner.evaluation.view_images import VARIANTS, ViewPictures
from vpltune.tuner.metrics.error_maps import DIVERGING, MAGMA, map_png, signed_error
from vpltune.tuner.metrics.tone_curve import LUMINANCE, display_picture
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
    pictures: dict[str, str]
    """data: addresses of `SHOWN`, exposed and tone-mapped."""
    signed_maps: dict[str, str]
    flip_maps: dict[str, str]
    linear: dict[str, Any]
    """What the script reads: sizes, exposures, and half floats by name, see `packed_halves`."""

    @property
    def weight(self) -> int:
        """Bytes that it adds to the page."""
        texts = (self.pictures, self.signed_maps, self.flip_maps, self.linear["halves"])
        return sum(len(text) for part in texts for text in part.values())


def view_block(pictures: ViewPictures, measured: dict[str, Any]) -> ViewBlock:
    """Everything a page shows of one view. `measured` is its entry in `per_view`."""
    valid = pictures.valid
    exposures = {
        "picture": picture_exposure(pictures),
        "irradiance": _exposure(pictures.indirect["reference"], valid),
    }
    signed = {
        name: signed_error(pictures.indirect[name], pictures.indirect["reference"], valid)
        for name in VARIANTS
    }
    light = pictures.light("reference")
    flip = {name: hdr_flip_map(pictures.light(name), light) for name in VARIANTS}
    everywhere = np.ones_like(valid)
    height, width = valid.shape
    return ViewBlock(
        index=pictures.index,
        name=str(measured.get("name", f"view {pictures.index}")),
        split=str(measured.get("split", "")),
        width=width,
        height=height,
        figures={name: measured[name] for name in VARIANTS if isinstance(measured.get(name), dict)},
        noise_floor=measured.get("noise_floor"),
        samples=measured.get("samples"),
        pictures={
            name: png_address(display_picture(pictures.radiance(name), exposures["picture"]))
            for name in SHOWN
        },
        signed_maps={
            name: data_address(map_png(signed[name], -1.0, 1.0, DIVERGING, valid)) for name in VARIANTS
        },
        flip_maps={name: data_address(map_png(flip[name], 0.0, 1.0, MAGMA, everywhere)) for name in VARIANTS},
        linear={
            "width": width,
            "height": height,
            "level": pictures.level,
            "exposures": exposures,
            "halves": {name: packed_halves(picture) for name, picture in _linear(pictures).items()},
        },
    )


def _linear(pictures: ViewPictures) -> dict[str, np.ndarray]:
    return {
        "reference_albedo": pictures.reference_albedo,
        "reference_direct": pictures.reference_direct,
        "albedo": pictures.albedo,
        "direct": pictures.direct,
        **{f"{name}_indirect": pictures.indirect[name] for name in SHOWN},
    }


def packed_halves(picture: np.ndarray) -> str:
    """A linear picture as text: half floats, low bytes before high ones, plane by plane; zlib, base64.

    Bytes sorted like that weigh a quarter less than side by side.
    """
    halves = np.ascontiguousarray(picture.astype("<f2"))
    planes = halves.view(np.uint8).reshape(*halves.shape, 2).transpose(3, 2, 0, 1)
    return base64.b64encode(zlib.compress(planes.tobytes(), 9)).decode("ascii")


def png_address(picture: np.ndarray) -> str:
    """An 8-bit picture as a data: address."""
    file = io.BytesIO()
    Image.fromarray(picture).save(file, "PNG", optimize=True)
    return data_address(file.getvalue())


def data_address(png: bytes) -> str:
    """A PNG file as a data: address."""
    return f"data:image/png;base64,{base64.b64encode(png).decode('ascii')}"


def picture_exposure(pictures: ViewPictures) -> float:
    """What a whole picture of the view is multiplied by before the tone curve, in every variant."""
    return _exposure(pictures.radiance("reference"), pictures.valid)


def _exposure(linear: np.ndarray, valid: np.ndarray) -> float:
    """What brings the mean luminance to the runtime's key."""
    level = float((linear[valid].astype(np.float64) @ LUMINANCE).mean()) if valid.any() else 0.0
    return EXPOSURE_KEY / level if level > 0.0 else 1.0
