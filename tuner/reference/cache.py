"""References kept in the user's cache folder, found again by what they were made from."""

import contextlib
import fcntl
import hashlib
import io
import logging
import os
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import numpy as np
import platformdirs

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import written_whole
from vpltune.tuner.reference.reference_view import ReferenceView

SIZE_LIMIT = 2 * 2**30
"""Bytes kept; beyond them, the entries that were not used for longest go."""

LOOK_SHARE = 1 / 64
"""Of the limit, that a process stores between two looks at the size of the folder: each asks for the size of
every entry, and a thousand processes on one file server would do nothing else."""

_SUFFIX = ".reference"
_DIGEST_BYTES = 32
_log = logging.getLogger(__name__)
_stored_bytes = 0


def cache_folder() -> Path:
    """The folder named by the environment variable VPLTUNE_CACHE, else the user's own for this program."""
    named = os.environ.get("VPLTUNE_CACHE")
    return Path(named) if named else Path(platformdirs.user_cache_dir("vpltune", appauthor=False))


def load(key: str) -> ReferenceView | None:
    """The entry of `key`, or None where there is none or it is not what was written under that key."""
    path = _path(key)
    try:
        data = path.read_bytes()
    except OSError:
        return None
    payload = data[_DIGEST_BYTES:]
    if _digest(key, payload) != data[:_DIGEST_BYTES]:
        _log.warning("%s: damaged, made again", path)
        return None
    with contextlib.suppress(OSError):
        os.utime(path)
    _log.debug("reference read from %s", path)
    with np.load(io.BytesIO(payload), allow_pickle=False) as arrays:
        found = {name: arrays[name] for name in arrays.files}
    return ReferenceView(**{name: a if a.ndim else a.item() for name, a in found.items()})


def store(key: str, reference: ReferenceView) -> None:
    """Keep `reference` under `key`, whole or not at all; a folder that cannot be written to is no error.

    Whoever stores holds `locked(key)`.
    """
    global _stored_bytes
    arrays = {field.name: np.asarray(getattr(reference, field.name)) for field in fields(reference)}
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    payload = buffer.getvalue()
    path = _path(key)
    try:
        for leftover in path.parent.glob(f".{key}-*{_SUFFIX}"):  # of a process killed while it wrote
            leftover.unlink(missing_ok=True)
        with written_whole(path) as temporary:
            temporary.write_bytes(_digest(key, payload) + payload)
        _log.debug("reference kept in %s", path)
        _stored_bytes += len(payload)
        if _stored_bytes > LOOK_SHARE * SIZE_LIMIT:
            _stored_bytes = 0
            _drop_oldest()
    except (OSError, InputError) as error:
        _log.warning("references are not kept: %s", error)


@contextlib.contextmanager
def locked(key: str) -> Iterator[None]:
    """Hold `key` alone among processes, so that none makes what another is making.

    The lock is the kernel's own and ends with its process, however that ends.
    """
    path = _path(key).with_suffix(".lock")
    handle = _lock(path)
    if handle is None:
        yield
        return
    try:
        yield
    finally:
        # Unlinked while held: no lock files pile up, and whoever waits on this one sees that it is gone.
        path.unlink(missing_ok=True)
        os.close(handle)


def remove_leftovers() -> None:
    """Remove what killed processes left in the folder: locks that nobody holds, files half written."""
    folder = _path("").parent
    for path in [*folder.glob("*.lock"), *folder.glob(f".*{_SUFFIX}")]:
        key = path.stem.removeprefix(".").partition("-")[0]
        handle = _lock(_path(key).with_suffix(".lock"), wait=False)
        if handle is not None:
            path.unlink(missing_ok=True)
            _path(key).with_suffix(".lock").unlink(missing_ok=True)
            os.close(handle)


def _lock(path: Path, wait: bool = True) -> int | None:
    """An open file that holds the lock; None where none can be had, or another process has it."""
    while True:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except OSError:
            return None
        try:
            fcntl.flock(handle, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(handle)
            return None
        except OSError:
            pass  # some network file systems cannot lock
        # A lock on a file that its last holder unlinked keeps nobody off.
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), path.stat()):
                return handle
        os.close(handle)


def _digest(key: str, payload: bytes) -> bytes:
    # The key too: an entry under another's name is as wrong as a torn one.
    return hashlib.sha256(key.encode() + payload).digest()


def _path(key: str) -> Path:
    return cache_folder() / "references" / f"{key}{_SUFFIX}"


def _drop_oldest() -> None:
    entries = []
    for path in (cache_folder() / "references").glob(f"*{_SUFFIX}"):
        with contextlib.suppress(OSError):
            status = path.stat()
            entries.append((status.st_mtime, status.st_size, path))
    total = sum(size for _, size, _ in entries)
    for _, size, path in sorted(entries, key=lambda entry: entry[0]):
        if total <= SIZE_LIMIT:
            return
        path.unlink(missing_ok=True)
        total -= size
