"""Who is at work on a scene: a file held by one process at a time, and free again when that process dies.

On one machine the kernel's lock on the file says whether its holder lives, and ends with it. Between
machines whose file system does not carry locks, the holder's host in the file and a heartbeat (the file's
time of change) say it: a claim of another host counts until its heart has not beaten for `STALE_SECONDS`.
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
STALE_SECONDS = 120.0
"""Of another host's silence: eight missed beats, or a file server that was away for two minutes."""


@contextlib.contextmanager
def claimed(path: Path) -> Iterator[bool]:
    """Hold `path` alone; yields False at once where another process does.

    The file is gone afterwards, unless the process is killed: then it lies there, free, for the next.
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
        # Unlinked while held: whoever opened it before finds it gone once the lock is theirs.
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
        # Some network file systems cannot lock at all; the heartbeat alone speaks there.
        return error.errno not in (errno.EWOULDBLOCK, errno.EACCES)
    return True


def _held_elsewhere(handle: int) -> bool:
    """Whether a process of another host wrote the claim and may yet live."""
    try:
        host = json.loads(os.pread(handle, 4096, 0))["host"]
    except (ValueError, KeyError, TypeError):
        return False
    return host != socket.gethostname() and time.time() - os.fstat(handle).st_mtime < STALE_SECONDS


def _beat(handle: int, stopped: threading.Event) -> None:
    while not stopped.wait(HEARTBEAT_SECONDS):
        with contextlib.suppress(OSError):
            os.utime(handle)
