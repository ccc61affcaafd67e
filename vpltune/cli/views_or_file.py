"""`--views N|FILE`: a number of views, or the views of a file."""

from pathlib import Path

from vpltune.cli.options import LARGEST_VIEW_COUNT
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.views import View, read_views


def views_or_file(text: str, placed: bool) -> int | tuple[Path, tuple[View, ...]]:
    """A number of views, or a file and its views.

    Args:
        text: what the user gave.
        placed: whether there are flags of camera or light too.

    Raises:
        InputError: the number is out of range, the file cannot be used, or there are flags beside a file.
    """
    if text.isascii() and text.isdecimal():
        if not 1 <= len(text) <= 4 or not 1 <= int(text) <= LARGEST_VIEW_COUNT:
            raise InputError(f"--views: must be from 1 to {LARGEST_VIEW_COUNT}, or a file, got {text:.60}")
        return int(text)
    if placed:
        raise InputError("--views: a file has its own cameras and lights; leave out the flags for these")
    return Path(text), read_views(Path(text))
