"""Video files: an H.264 .mp4, or a folder of numbered .png files."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

import imageio_ffmpeg
import numpy as np
from jaxtyping import UInt8

from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.files.atomic_file import written_whole
from vpltune.renderer.files.image_file import write_png

QUALITY = 8
"""A choice: quality on imageio-ffmpeg's scale of 0 to 10, with hardly any visible loss."""

Image = UInt8[np.ndarray, "height width 3"]


def check_clip_path(path: Path, size: tuple[int, int]) -> None:
    """Check that a clip of `size` = (width, height) pixels can be written to `path`. Call it before drawing.

    Raises:
        InputError: the path is neither an .mp4 nor a folder, or an .mp4 would have an odd width or height
            (its chroma has half the resolution).
    """
    suffix = path.suffix.lower()
    if suffix == ".mp4":
        if size[0] % 2 or size[1] % 2:
            raise InputError(f"{path}: an .mp4 must have even sides, got {size[0]}x{size[1]}")
    elif suffix:
        raise InputError(f"{path}: a clip must be an .mp4 or a folder for .png files, got {suffix!r}")
    elif path.exists() and not path.is_dir():
        raise InputError(f"{path}: must be a folder for .png files, got a file")


@contextlib.contextmanager
def clip_writer(path: Path, size: tuple[int, int], fps: float) -> Iterator[Callable[[Image], None]]:
    """Yield a function that writes one frame per call.

    An .mp4 is written atomically when the block ends without an exception. In a folder, each frame is written
    atomically, frames stay after an interrupt, and existing frames with the same number are replaced.

    Args:
        path: an .mp4 or a folder.
        size: width and height in pixels.
        fps: frames per second of an .mp4.

    Raises:
        InputError: `check_clip_path` rejects the path, or it cannot be written to.
        MachineError: the encoder fails.
    """
    check_clip_path(path, size)
    if path.suffix.lower() == ".mp4":
        with written_whole(path) as temporary, _encoder(temporary, size, fps) as write:
            yield write
        return
    count = 0

    def write_numbered(image: Image) -> None:
        nonlocal count
        write_png(path / f"frame_{count:05d}.png", image)
        count += 1

    yield write_numbered


@contextlib.contextmanager
def _encoder(path: Path, size: tuple[int, int], fps: float) -> Iterator[Callable[[Image], None]]:
    encoder = imageio_ffmpeg.write_frames(
        str(path),
        size,
        fps=fps,  # pyright: ignore[reportArgumentType]  (its type is read off a whole default)
        codec="libx264",
        quality=QUALITY,
        # The default of 16 would resize the image unless 16 divides both sides. They are even, so 2 does.
        macro_block_size=2,
        output_params=["-movflags", "+faststart"],
        ffmpeg_log_level="error",
    )
    encoder.send(None)

    def write(image: Image) -> None:
        try:
            encoder.send(np.ascontiguousarray(image))
        except OSError as error:
            raise MachineError(
                f"{path.name}: the video encoder failed ({str(error).splitlines()[0]})"
            ) from error

    try:
        yield write
    finally:
        encoder.close()
