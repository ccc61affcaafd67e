"""A claim on a scene: a file that one process holds at a time, and that is free again when the process dies.

On one machine the holder locks the file, and the kernel releases the lock when the holder ends. Some network
file systems have no locks. For these, the file names the holder's host, and a heartbeat updates its
modification time. A claim by another host is valid until its heartbeat is `STALE_SECONDS` old.
"""

import contextlib
import errno
import fcntl
import json
import os
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

HEARTBEAT_SECONDS = 15.0
"""Interval between two heartbeats. A choice."""
STALE_SECONDS = 120.0
"""Age of the last heartbeat at which another host's claim lapses. A choice: eight missed beats, so a file
server may be unreachable for up to two minutes."""


@contextlib.contextmanager
def claimed(path: Path) -> Iterator[bool]:
    """Claim `path`. Yields True, or at once False if another process holds the claim.

    The file is deleted afterwards. If the process is killed, the file remains but can be claimed by the next.
    """
    handle = _taken(path)
    if handle is None:
        yield False
        return
    stopped = threading.Event()
    heart = threading.Thread(target=_beat, args=(handle, stopped), daemon=True)
    heart.start()
    try:
        yield True
    finally:
        stopped.set()
        heart.join()
        # Unlink while holding the lock: a process that has already opened the file then finds it gone.
        path.unlink(missing_ok=True)
        os.close(handle)


def _taken(path: Path) -> int | None:
    path.parent.mkdir(parents=True, exist_ok=True)
    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        if not _locked(handle):
            os.close(handle)
            return None
        try:
            same = os.path.samestat(os.fstat(handle), path.stat())
        except FileNotFoundError:
            same = False
        if not same:
            os.close(handle)
            continue
        if _held_elsewhere(handle):
            os.close(handle)
            return None
        os.ftruncate(handle, 0)
        os.pwrite(handle, json.dumps({"host": socket.gethostname(), "pid": os.getpid()}).encode(), 0)
        return handle


def _locked(handle: int) -> bool:
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        # Some network file systems have no locks; only the heartbeat counts there.
        return error.errno not in (errno.EWOULDBLOCK, errno.EACCES)
    return True


def _held_elsewhere(handle: int) -> bool:
    """Whether another host wrote the claim and its heartbeat is recent."""
    try:
        host = json.loads(os.pread(handle, 4096, 0))["host"]
    except (ValueError, KeyError, TypeError):
        return False
    return host != socket.gethostname() and time.time() - os.fstat(handle).st_mtime < STALE_SECONDS


def _beat(handle: int, stopped: threading.Event) -> None:
    while not stopped.wait(HEARTBEAT_SECONDS):
        with contextlib.suppress(OSError):
            os.utime(handle)
