"""Image files: PNG for display, EXR for linear values. Row 0 is at the top in both."""

from pathlib import Path
from typing import Literal

import numpy as np
import OpenEXR
from jaxtyping import Float, Float32, UInt8
from PIL import Image

from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.files.atomic_file import written_whole


def require_extension(path: Path, *extensions: str) -> str:
    """The extension of `path` in lower case, checked to be one of `extensions`. Call it before long work.

    Raises:
        InputError: the extension is not one of `extensions`.
    """
    extension = Path(path).suffix.lower()
    if extension not in extensions:
        raise InputError(f"{path}: the file name must end in {' or '.join(extensions)}, got {extension!r}")
    return extension


def write_png(
    path: Path, image: UInt8[np.ndarray, "height width 3"] | Float[np.ndarray, "height width 3"]
) -> None:
    """Write a display-referred, sRGB-encoded image with 8 bits per channel.

    Floats are clamped to [0, 1], where 1 is white, and rounded to the nearest step.

    Raises:
        InputError: the name does not end in .png, a float is NaN, or the path cannot be written to.
    """
    require_extension(path, ".png")
    if image.dtype != np.uint8:
        if np.isnan(image).any():
            raise InputError(f"{path}: the image must not hold NaN, which a PNG cannot store")
        image = np.round(np.clip(image, 0.0, 1.0) * 255.0).astype(np.uint8)
    with written_whole(Path(path)) as temporary:
        Image.fromarray(image, "RGB").save(temporary, optimize=False)


def write_exr(
    path: Path,
    pixels: Float32[np.ndarray, "height width 3"] | Float32[np.ndarray, "height width"],
    channel: Literal["Y", "Z"] = "Y",
) -> None:
    """Write linear values as float32 to the channels R, G and B, or to the single channel `channel`.

    OpenEXR recommends the names Z for depth and Y for luminance. NaN and infinity are kept.

    Raises:
        InputError: the name does not end in .exr, or the path is a folder.
        MachineError: the path cannot be written to.
    """
    require_extension(path, ".exr")
    channels = {"RGB" if pixels.ndim == 3 else channel: np.ascontiguousarray(pixels)}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with written_whole(Path(path)) as temporary, OpenEXR.File(header, channels) as file:
        try:
            file.write(str(temporary))
        except RuntimeError as error:
            raise MachineError(f"{path}: cannot be written ({str(error).splitlines()[-1]})") from error


def read_exr(
    path: Path,
) -> Float32[np.ndarray, "height width 3"] | Float32[np.ndarray, "height width"]:
    """Read the channels R, G and B, without alpha, or else the only channel, as float32.

    Raises:
        InputError: the name does not end in .exr, the file is not a readable EXR, or it has other channels.
    """
    require_extension(path, ".exr")
    if not Path(path).is_file():
        raise InputError(f"{path}: cannot be read (no such file)")
    try:
        with OpenEXR.File(str(path)) as file:
            channels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    except (RuntimeError, OSError) as error:
        raise InputError(f"{path}: not a readable EXR file ({error})") from error
    for name in ("RGB", "RGBA"):
        if name in channels:
            return channels[name][..., :3].astype(np.float32)
    if len(channels) == 1:
        return next(iter(channels.values())).astype(np.float32)
    raise InputError(f"{path}: must hold channels R, G, B or a single one, got {', '.join(sorted(channels))}")
