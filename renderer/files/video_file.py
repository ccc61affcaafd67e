"""Video files: an H.264 .mp4, or a folder of numbered .png files."""

import contextlib
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import imageio_ffmpeg
import numpy as np
from jaxtyping import UInt8

from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.files.atomic_file import written_together, written_whole
from vpltune.renderer.files.image_file import write_png

RATE_FACTOR = 10
"""x264's constant rate factor (0 lossless, 51 worst). A choice: hardly any visible loss."""

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

    A clip is written when the block ends without an exception; until then, an earlier one stays whole. In a
    folder, its frames replace those of the earlier clip, even if that was longer, and other files stay.

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
        with written_whole(path) as temporary, _encoder(temporary, path, size, fps) as write:
            yield write
        return
    count = 0
    with written_together(path) as folder:

        def write_numbered(image: Image) -> None:
            nonlocal count
            write_png(folder / f"frame_{count:05d}.png", image)
            count += 1

        yield write_numbered
    for earlier in path.glob("frame_*.png"):
        number = earlier.stem.removeprefix("frame_")
        if number.isdecimal() and int(number) >= count:
            earlier.unlink()


@contextlib.contextmanager
def _encoder(
    temporary: Path, path: Path, size: tuple[int, int], fps: float
) -> Iterator[Callable[[Image], None]]:
    width, height = size
    command = [
        *(imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-loglevel", "error", "-nostdin"),
        *("-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:g}", "-i", "-"),
        *("-c:v", "libx264", "-crf", str(RATE_FACTOR), "-pix_fmt", "yuv420p", "-movflags", "+faststart"),
        str(temporary),
    ]
    # In a session of its own: Ctrl-C in the terminal would end it before the command, which would then say
    # that the encoder failed.
    encoder = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)
    assert encoder.stdin is not None
    assert encoder.stderr is not None
    frames, said = encoder.stdin, encoder.stderr

    def write(image: Image) -> None:
        # A dead encoder closes its end; its exit code and its last words say why.
        with contextlib.suppress(BrokenPipeError):
            frames.write(np.ascontiguousarray(image).tobytes())
            return
        end()

    def end() -> None:
        with contextlib.suppress(BrokenPipeError):
            frames.close()
        words = said.read().decode("utf-8", "replace").strip().splitlines()
        if encoder.wait() or words:
            # "[out#0/mp4 @ 0x…] No space left": where in ffmpeg is of no use to anybody.
            reason = words[0].rpartition("] ")[2] if words else f"exit code {encoder.returncode}"
            raise MachineError(f"{path}: the video encoder failed ({reason})")

    try:
        yield write
        end()
    finally:
        encoder.kill()
        encoder.wait()
        said.close()
        with contextlib.suppress(BrokenPipeError):
            frames.close()
