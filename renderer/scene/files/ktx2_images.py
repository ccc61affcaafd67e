"""KHR_texture_basisu: images of Basis Universal blocks in a KTX2 file."""

import importlib.util
import struct

import numpy as np
from jaxtyping import UInt8

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.image_texels import ImageDecoder
from vpltune.renderer.scene.files.limited_decoder import LimitedDecoder
from vpltune.renderer.scene.files.limits import KTX2_SECONDS, KTX2_TEXELS_PER_SECOND

# KTX 2.0, section 3.1: the identifier, then from byte 20 width, height, depth, layers and faces.
_IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
_SIZES = struct.Struct("<20x5I")
# The module of the extra [ktx].
_DECODER_MODULE = "opengl_basisu"


def is_ktx2(content: bytes | memoryview) -> bool:
    """Whether a file says of itself that it is KTX2."""
    return bytes(content[: len(_IDENTIFIER)]) == _IDENTIFIER


class Ktx2Decoder:
    """Decodes the KTX2 images of one scene.

    Args:
        images: counts the scene's images.
        process: decodes blocks.
    """

    def __init__(self, images: ImageDecoder, process: LimitedDecoder) -> None:
        self._images = images
        self._process = process

    def decode(self, content: bytes | memoryview, where: str) -> UInt8[np.ndarray, "height width 3"]:
        """The colours of an image's largest level, row 0 at the top. Alpha is ignored.

        Args:
            content: the file.
            where: the place in the scene's file, for messages.

        Raises:
            SceneFileError: the extra [ktx] is not installed, or the image is not flat, broken or too large.
        """
        return self._channels(content, where, 0, 3)

    def opacity(self, content: bytes | memoryview, where: str) -> UInt8[np.ndarray, "height width"] | None:
        """The alpha of an image's largest level, row 0 at the top; None where all is opaque.

        Raises:
            SceneFileError: as `decode`.
        """
        texels = self._channels(content, where, 3, 4)
        return None if texels.min() == 255 else texels[..., 0]

    def _channels(
        self, content: bytes | memoryview, where: str, first: int, end: int
    ) -> UInt8[np.ndarray, "height width channels"]:
        if importlib.util.find_spec(_DECODER_MODULE) is None:
            raise SceneFileError(
                f"{where}: a KTX2 texture needs vpltune[ktx], which is not installed: "
                'pip install "vpltune[ktx]"'
            )
        width, height = _size(content, where)
        self._images.admit((width, height), len(content), where)
        seconds = KTX2_SECONDS + width * height // KTX2_TEXELS_PER_SECOND
        answer = self._process.answer(content, seconds, channels=(first, end))
        if "error" in answer:
            raise SceneFileError(f"{where}: image is broken ({answer['error']})")
        ((dtype, shape),) = answer["arrays"]
        if dtype != "|u1" or shape != [height, width, end - first]:
            raise SceneFileError(f"{where}: image is broken (its blocks are not {width} × {height} texels)")
        try:
            return self._process.array(dtype, shape)
        except EOFError as error:
            raise SceneFileError(f"{where}: image is broken ({self._process.end(seconds)})") from error


def _size(content: bytes | memoryview, where: str) -> tuple[int, int]:
    """Width and height that the header says."""
    if len(content) < _SIZES.size:
        raise SceneFileError(f"{where}: image is broken (cut off in its header)")
    width, height, depth, layers, faces = _SIZES.unpack_from(content)
    if width == 0 or height == 0 or depth != 0 or layers > 1 or faces != 1:
        raise SceneFileError(
            f"{where}: a KTX2 texture must be one flat image, got {width} × {height} × {depth} texels, "
            f"{layers} layers, {faces} faces"
        )
    return width, height
