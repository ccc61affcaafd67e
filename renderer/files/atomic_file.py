"""Atomic writes: a file, or a set of files, is written completely or not at all."""

import contextlib
import errno
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.files import unfinished_files

TRIAL_BYTES = 1 << 16
"""Bytes that `require_writable` tries to write. A choice: more than any file system keeps within an inode."""
_READABLE_BY_ALL = 0o644
"""mkstemp makes files that only their owner may read."""


@contextlib.contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; on success, sync it and rename it to `path`.

    The temporary file has the same suffix, because image writers may depend on it. On any exception or
    interrupt, it is removed and `path` stays as it was.

    Raises:
        InputError: the folder cannot be created, or `path` is itself a folder.
        MachineError: the disk is full or read-only, or nothing was written.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path}: cannot be written (it is a folder)")
    temporary = _temporary(path)
    try:
        yield temporary
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        if not temporary.stat().st_size:
            raise MachineError(f"{path}: cannot be written (the file stayed empty; is the disk full?)")
        temporary.chmod(_READABLE_BY_ALL)
        temporary.replace(path)
    except OSError as error:
        if error.errno not in _DISK and error.filename != str(temporary):
            raise
        raise MachineError(f"{path}: cannot be written ({error.strerror})") from error
    finally:
        unfinished_files.ended(temporary)


def write_text_whole(path: Path, text: str) -> None:
    """Write `text` to `path` as UTF-8, atomically.

    Raises:
        InputError, MachineError: as `written_whole`.
    """
    with written_whole(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


@contextlib.contextmanager
def written_together(folder: Path, earlier: Sequence[str] = ()) -> Iterator[Path]:
    """Yield an empty folder in `folder`; on success, move all files in and below it to `folder`.

    So a set of files changes whole: what can fail, fails before the first one is replaced. Other files in
    `folder` and below stay, but for those of an earlier set that this one lacks: `earlier` names them by
    patterns.

    Raises:
        InputError, MachineError: as `written_whole`.
    """
    require_writable(folder)
    folder.mkdir(parents=True, exist_ok=True)
    staging = unfinished_files.new_folder(folder)
    try:
        yield staging
        files = sorted(path for path in staging.rglob("*") if path.is_file())
        ready = {path: folder / path.relative_to(staging) for path in files}
        for named in ready.values():
            if named.is_dir():
                raise InputError(f"{named}: cannot be written (it is a folder)")
        for below in {named.parent for named in ready.values()} - {folder}:
            require_writable(below)
            below.mkdir(parents=True, exist_ok=True)
        for path, named in ready.items():
            path.replace(named)
        for left in [path for pattern in earlier for path in folder.glob(pattern)]:
            if left not in ready.values() and left.is_file():
                left.unlink()
    except (InputError, MachineError) as error:
        raise type(error)(str(error).replace(str(staging), str(folder))) from error
    finally:
        unfinished_files.ended(staging)


def require_writable(folder: Path) -> None:
    """Check that files can be written in `folder`, or where it would be created. Call it before long work.

    What killed processes left there is removed, which may be the room that is needed.

    Raises:
        InputError: the folder, or what it would be created in, is a file.
        MachineError: it cannot be written to, or the disk is full.
    """
    there = next(each for each in (folder, *folder.absolute().parents) if each.exists())
    if not there.is_dir():
        raise InputError(f"{there}: must be a folder, got a file")
    unfinished_files.remove_abandoned(there)
    try:
        trial = _temporary(there / "trial")
    except MachineError as error:
        raise MachineError(f"{folder}: cannot be written to ({error.__cause__})") from error
    try:
        with trial.open("wb") as file:
            file.write(bytes(TRIAL_BYTES))
            os.fsync(file.fileno())
    except OSError as error:
        raise MachineError(f"{folder}: cannot be written to ({error.strerror})") from error
    finally:
        unfinished_files.ended(trial)


_DISK = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)
"""What a disk answers that cannot take a file; other errors within `written_whole` may be of other files."""


def _temporary(path: Path) -> Path:
    """A new, empty file beside `path`, in a folder that is created."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return unfinished_files.new_file(path.parent, path.suffix)
    except OSError as error:
        line = f"{path}: cannot be written ({error.strerror})"
        lacks = error.errno in (*_DISK, errno.EACCES, errno.EPERM)
        raise (MachineError if lacks else InputError)(line) from error
