"""Atomic writes: a file is written completely or not at all."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from vpltune.renderer.errors import InputError
from vpltune.renderer.files import unfinished_files


@contextlib.contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on success, sync it and rename it to `path`.

    The temporary file has the same suffix, because image writers may depend on it. On any exception or
    interrupt, it is removed and `path` stays as it was.

    Raises:
        InputError: the folder cannot be created or written to, or `path` is itself a folder.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path}: cannot be written (it is a folder)")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from error
    os.close(handle)
    temporary = Path(name)
    unfinished_files.begun(temporary)
    try:
        yield temporary
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        temporary.chmod(0o644)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
        unfinished_files.ended(temporary)


def write_text_whole(path: Path, text: str) -> None:
    """Write `text` to `path` as UTF-8, atomically.

    Raises:
        InputError: the folder cannot be created or written to, or `path` is itself a folder.
    """
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
