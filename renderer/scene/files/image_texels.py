"""Decoding of images to sRGB-encoded texels with eight bits for each of red, green and blue."""

import io
import struct
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from vpltune.renderer.scene.files.diagnostics import SceneFileError, mebibytes
from vpltune.renderer.scene.files.limits import (
    FREE_TEXELS,
    MAX_IMAGE_BYTES,
    MAX_IMAGE_SIDE,
    MAX_IMAGE_TEXELS,
    MAX_SCENE_TEXELS,
    TEXELS_PER_BYTE,
)

# PIL's names of the formats that glTF and EXT_texture_webp allow.
GLTF_FORMATS = ("PNG", "JPEG", "WEBP")
# A choice: rows converted at a time. Converting all at once would hold a large image three times in memory.
_STRIP_ROWS = 256
# A choice: PIL's names of the formats accepted for OBJ, PLY and Mitsuba.
MTL_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TGA")


class ImageDecoder:
    """Decodes the images of one scene and enforces the scene's texel limit."""

    def __init__(self, formats: tuple[str, ...]) -> None:
        self._formats = formats
        self._texels = 0
        self._bytes = 0

    def decode(self, content: bytes | memoryview, where: str) -> UInt8[np.ndarray, "height width 3"]:
        """The texels of an image file, row 0 at the top.

        Alpha, colour profiles, gamma and orientation in the file are ignored, as glTF requires.

        Raises:
            SceneFileError: the format is unsupported, or the image is broken, cut off or too large.
        """
        return self._read(content, where, lambda image: _strips(image, _strip_rgb, 3))

    def opacity(self, content: bytes | memoryview, where: str) -> UInt8[np.ndarray, "height width"] | None:
        """The alpha channel of an image file, row 0 at the top; None without one, or where all is opaque.

        Raises:
            SceneFileError: as `decode`.
        """
        texels = self._read(content, where, _alpha)
        return None if texels is None or texels.min() == 255 else texels[..., 0]

    def _read(self, content: bytes | memoryview, where: str, convert: Callable[[Image.Image], Any]) -> Any:
        _check_length(len(content), where)
        try:
            # Opening reads the header only, so the size is checked before anything is unpacked.
            with warnings.catch_warnings():
                # PIL warns of odd headers and large sizes; `admit` decides on size.
                warnings.simplefilter("ignore")
                with Image.open(io.BytesIO(content), formats=self._formats) as image:
                    self.admit(image.size, len(content), where)
                    return convert(image)
        except SceneFileError:
            raise
        except Image.DecompressionBombError as error:
            raise SceneFileError(f"{where}: {error}") from error
        except (OSError, SyntaxError, ValueError, EOFError, struct.error, IndexError) as error:
            # PIL's own message for an unknown format contains a memory address.
            cause = (
                f"must be one of {', '.join(self._formats)}"
                if "cannot identify" in str(error)
                else f"is broken ({error})"
            )
            raise SceneFileError(f"{where}: image {cause}") from error

    def admit(self, size: tuple[int, int], encoded: int, where: str) -> None:
        """Count an image of the scene before it is decoded.

        Args:
            size: width and height in texels, as its header says.
            encoded: bytes of its file.
            where: the place in the file, for messages.

        Raises:
            SceneFileError: the image is too large, or all so far are together.
        """
        _check_length(encoded, where)
        width, height = size
        if max(size) > MAX_IMAGE_SIDE or width * height > MAX_IMAGE_TEXELS:
            raise SceneFileError(
                f"{where}: an image must be at most {MAX_IMAGE_SIDE} texels on a side and "
                f"{MAX_IMAGE_TEXELS:,} in all, got {width} × {height}"
            )
        self._bytes += encoded
        self.spend(width * height, f"this one of {width} × {height}", where)

    def spend(self, texels: int, what: str, where: str) -> None:
        """Count texels, also of images that are made of decoded ones. Messages call them `what`.

        Raises:
            SceneFileError: the scene has too many.
        """
        self._texels += texels
        most = min(FREE_TEXELS + TEXELS_PER_BYTE * self._bytes, MAX_SCENE_TEXELS)
        if self._texels > most:
            raise SceneFileError(
                f"{where}: the images of this scene must have at most {most:,} texels together, and with "
                f"{what} they have {self._texels:,}"
            )


def _check_length(encoded: int, where: str) -> None:
    if encoded > MAX_IMAGE_BYTES:
        raise SceneFileError(
            f"{where}: an image file must have at most {MAX_IMAGE_BYTES >> 20} MiB, got {mebibytes(encoded)}"
        )


def _alpha(image: Image.Image) -> UInt8[np.ndarray, "height width 1"] | None:
    if not image.has_transparency_data:
        return None
    return _strips(image, lambda strip: np.asarray(strip.convert("RGBA"))[..., 3:], 1)


def _strips(
    image: Image.Image, convert: Callable[[Image.Image], np.ndarray], channels: int
) -> UInt8[np.ndarray, "height width channels"]:
    width, height = image.size
    texels = np.empty((height, width, channels), np.uint8)
    for top in range(0, height, _STRIP_ROWS):
        strip = image.crop((0, top, width, min(top + _STRIP_ROWS, height)))
        texels[top : top + _STRIP_ROWS] = convert(strip)
    return texels


def _strip_rgb(strip: Image.Image) -> UInt8[np.ndarray, "height width _"]:
    if strip.mode.startswith("I") or strip.mode == "F":
        # 16-bit grey. PIL's own conversion to 8 bits clips values instead of dividing them by 257.
        return ((np.clip(np.asarray(strip), 0, 65535).astype(np.uint32) + 128) // 257).astype(np.uint8)[
            :, :, None
        ]
    return np.asarray(strip.convert("RGB"))
