"""The pixels of OpenEXR images, checked by the header before anything is decoded."""

import math
import tempfile
from pathlib import Path

import numpy as np
import OpenEXR
from jaxtyping import Float32

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.image_texels import ImageDecoder
from vpltune.renderer.scene.files.limits import DecodedBytes

# Bytes of a pixel in each channel: half, single precision and unsigned integers take at most four.
_BYTES_PER_VALUE = 4


def exr_channels(content: bytes, where: str) -> list[np.ndarray]:
    """Red, green and blue of an OpenEXR image, each [height, width], in single precision.

    Args:
        content: the file.
        where: the place in the scene's file, for messages.

    Raises:
        SceneFileError: the image is too large, is broken or lacks a channel, or a value is negative or not
            finite.
    """
    # OpenEXR 3.3 can only read from a file.
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "environment.exr"
        copy.write_bytes(content)
        try:
            _check_header(OpenEXR.File(str(copy), header_only=True), len(content), where)
            # As one array, the channels would take twice the memory.
            channels = OpenEXR.File(str(copy), separate_channels=True, num_threads=0).channels()
        except SceneFileError:
            raise
        except Exception as error:  # OpenEXR raises many types, none of its own
            raise SceneFileError(f"{where}: is not an OpenEXR image ({error})") from error
    if not all(name in channels for name in "RGB"):
        raise SceneFileError(f"{where}: must have channels R, G and B, got {', '.join(sorted(channels))}")
    pixels = [_single(channels[name].pixels) for name in "RGB"]
    # The least and the largest are no numbers if any pixel is none.
    if not all(channel.min() >= 0.0 and channel.max() < math.inf for channel in pixels):
        raise SceneFileError(f"{where}: radiance must be finite and ≥ 0")
    return pixels


def _single(values: np.ndarray) -> Float32[np.ndarray, "height width"]:
    """The values in single precision. Half precision goes by a table, five times as fast as numpy."""
    if values.dtype != np.float16:
        return values.astype(np.float32, copy=False)
    table = np.arange(1 << 16, dtype=np.uint16).view(np.float16).astype(np.float32)
    return table[values.view(np.uint16)]


def _check_header(header_only: OpenEXR.File, encoded: int, where: str) -> None:
    """Check the size of an image by its header, before anything is decoded: all parts, and all channels."""
    images, decoded = ImageDecoder(()), DecodedBytes(what="an environment map")
    for part in header_only.parts:
        low, high = part.header["dataWindow"]
        width, height = (int(high[axis]) - int(low[axis]) + 1 for axis in range(2))
        images.admit((width, height), encoded, where)
        decoded.spend(_BYTES_PER_VALUE * width * height * len(part.header["channels"]), where)
