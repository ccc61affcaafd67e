"""Images as sRGB-encoded texels: any PNG, JPEG or WebP brought to eight bits of red, green and blue."""

import io
import struct
import warnings

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from renderer.scene_file.diagnostics import SceneFileError
from renderer.scene_file.limits import MAX_IMAGE_SIDE, MAX_IMAGE_TEXELS, MAX_SCENE_TEXELS

GLTF_FORMATS = ("PNG", "JPEG", "WEBP")
MTL_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TGA")


class ImageDecoder:
    """Decodes the images of one scene, within its limit of texels."""

    def __init__(self, formats: tuple[str, ...]) -> None:
        self._formats = formats
        self._left = MAX_SCENE_TEXELS

    def decode(self, content: bytes, where: str) -> UInt8[np.ndarray, "height width 3"]:
        """Texels, row 0 at the top; alpha, profiles, gamma and orientation are left aside, as glTF asks.

        Raises:
            SceneFileError: not an image of a known format, broken, cut off, or too large.
        """
        try:
            # The header alone is read here, so that size is judged before anything is unpacked.
            with warnings.catch_warnings():
                # PIL says things of odd headers and large sizes; the size is judged here.
                warnings.simplefilter("ignore")
                with Image.open(io.BytesIO(content), formats=self._formats) as image:
                    self._check_size(image.size, where)
                    return _rgb(image)
        except SceneFileError:
            raise
        except Image.DecompressionBombError as error:
            raise SceneFileError(f"{where}: {error}") from error
        except (OSError, SyntaxError, ValueError, EOFError, struct.error, IndexError) as error:
            # PIL's own words for an unknown format print a memory address.
            cause = (
                f"is no {', '.join(self._formats)}"
                if "cannot identify" in str(error)
                else f"is broken ({error})"
            )
            raise SceneFileError(f"{where}: image {cause}") from error

    def _check_size(self, size: tuple[int, int], where: str) -> None:
        width, height = size
        if max(size) > MAX_IMAGE_SIDE or width * height > MAX_IMAGE_TEXELS:
            raise SceneFileError(
                f"{where}: an image must be at most {MAX_IMAGE_SIDE} texels on a side and "
                f"{MAX_IMAGE_TEXELS:,} in all, got {width} × {height}"
            )
        if width * height > self._left:
            raise SceneFileError(
                f"{where}: the images of a scene must have at most {MAX_SCENE_TEXELS:,} texels together"
            )
        self._left -= width * height


def _rgb(image: Image.Image) -> UInt8[np.ndarray, "height width 3"]:
    if image.mode.startswith("I") or image.mode == "F":
        # Sixteen-bit grey. PIL's own conversion to eight bits clips where it should divide by 257.
        grey = np.asarray(image, np.uint32)
        texels = np.minimum((grey + 128) // 257, 255).astype(np.uint8)
        return np.repeat(texels[:, :, None], 3, axis=2)
    return np.array(image.convert("RGB"), np.uint8)
