"""Text files that are read whole, up to a size: JSON and TOML that a user writes or edits."""

from pathlib import Path

from vpltune.renderer.errors import InputError


def read_small_text(path: Path, largest: int) -> str:
    """The text of a UTF-8 file, without its byte-order mark.

    Args:
        path: the file, or a pipe.
        largest: most bytes, so that a wrong path, such as a scene's or a device's, is not read whole.

    Raises:
        InputError: the file cannot be read, is too long, or is not UTF-8.
    """
    try:
        with path.open("rb") as file:
            content = file.read(largest + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    if len(content) > largest:
        raise InputError(f"{path}: must have at most {largest:,} bytes, has more")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text (byte {error.start})") from error
