"""On-disk cache of references, in the user's cache folder, keyed by a hash of their inputs."""

import contextlib
import fcntl
import hashlib
import io
import logging
import os
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.files.atomic_file import written_whole
from vpltune.renderer.files.cache_folder import cache_folder
from vpltune.renderer.files.unfinished_files import remove_abandoned
from vpltune.tuner.reference.reference_view import ReferenceView

SIZE_LIMIT = 2 * 2**30
"""Size of the cache in bytes. Above it, the least recently used entries are deleted. A choice: 2 GiB."""

LOOK_SHARE = 1 / 64
"""A process checks the size of the cache each time it has stored this share of `SIZE_LIMIT`. A choice: a
check queries the size of every entry, so checking at each store would overload a file server that many
processes share."""

_SUFFIX = ".reference"  # file name extension of a cache entry
_DIGEST_BYTES = 32  # length of a SHA-256 digest
_log = logging.getLogger(__name__)
_stored_bytes = 0


def load(key: str) -> ReferenceView | None:
    """The reference stored under `key`, or None if there is none or its checksum does not match."""
    path = _path(key)
    try:
        data = path.read_bytes()
    except OSError:
        return None
    payload = data[_DIGEST_BYTES:]
    if _digest(key, payload) != data[:_DIGEST_BYTES]:
        _log.warning("%s: damaged cache entry, rendered again", path)
        return None
    with contextlib.suppress(OSError):
        os.utime(path)
    _log.debug("reference read from %s", path)
    with np.load(io.BytesIO(payload), allow_pickle=False) as arrays:
        found = {name: arrays[name] for name in arrays.files}
    return ReferenceView(**{name: a if a.ndim else a.item() for name, a in found.items()})


def store(key: str, reference: ReferenceView) -> None:
    """Store `reference` under `key`, atomically. The caller holds `locked(key)`.

    A folder that cannot be written to is logged as a warning; it raises nothing.
    """
    global _stored_bytes
    values = {field.name: getattr(reference, field.name) for field in fields(reference)}
    arrays: dict[str, Any] = {name: np.asarray(value) for name, value in values.items() if value is not None}
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    payload = buffer.getvalue()
    path = _path(key)
    try:
        remove_abandoned(path.parent)
        with written_whole(path) as temporary:
            temporary.write_bytes(_digest(key, payload) + payload)
        _log.debug("reference kept in %s", path)
        _stored_bytes += len(payload)
        if _stored_bytes > LOOK_SHARE * SIZE_LIMIT:
            _stored_bytes = 0
            _drop_oldest()
    except (OSError, InputError, MachineError) as error:
        _log.warning("reference not cached: %s", error)


@contextlib.contextmanager
def locked(key: str) -> Iterator[None]:
    """Lock `key` against other processes, so that no two render the same reference.

    The kernel releases the lock when the process ends, even if it is killed. Where the file system has no
    locks, the block runs without one.
    """
    path = _path(key).with_suffix(".lock")
    handle = _lock(path)
    if handle is None:
        yield
        return
    try:
        yield
    finally:
        # Unlink while holding the lock: lock files do not pile up, and a process that waits for this one
        # notices that the file is gone.
        path.unlink(missing_ok=True)
        os.close(handle)


def remove_leftovers() -> None:
    """Delete what killed processes left in the cache: locks nobody holds and half-written files."""
    folder = _path("").parent
    remove_abandoned(folder)
    for path in folder.glob("*.lock"):
        handle = _lock(path, wait=False)
        if handle is not None:
            path.unlink(missing_ok=True)
            os.close(handle)


def _lock(path: Path, wait: bool = True) -> int | None:
    """A file descriptor that holds the lock.

    None if the file cannot be opened, or if another process holds the lock and `wait` is false.
    """
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
            pass  # some network file systems have no locks
        # The last holder may have unlinked this file. A lock on it then excludes nobody: open the new one.
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(handle), path.stat()):
                return handle
        os.close(handle)


def _digest(key: str, payload: bytes) -> bytes:
    # The key is hashed too, so that an entry renamed to another key counts as damaged.
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
