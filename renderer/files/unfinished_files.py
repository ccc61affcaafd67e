"""Temporary files: whose they are, and who removes them if their owner is killed.

A process that is killed removes nothing. Its guard (vpltune/guard.py) does, and hears of temporary files
through a pipe, which a process hands on to those that it starts with `inherited_pipe`. A guard that is killed
too leaves them. So each is locked by its owner, and the kernel frees the lock when the owner ends:
`remove_abandoned` removes what nobody has locked.
"""

import contextlib
import os
import shutil
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows has no such locks
    fcntl = None

PREFIX = ".vpltune-unfinished-"
"""Begins the name of every temporary file and folder, and of nothing that a user would make."""
VARIABLE = "VPLTUNE_UNFINISHED_FILES"
"""Names the pipe in the environment, as `descriptor:inode`. The inode tells it from a file that has got its
descriptor in a process that did not inherit it."""

_locks: dict[Path, int | None] = {}
"""Descriptors that lock what this process has begun; None where the file system has no locks."""


def new_file(folder: Path, suffix: str) -> Path:
    """A new, empty file in `folder`. Whoever calls this calls `ended`.

    Raises:
        OSError: it cannot be created.
    """

    def create() -> str:
        handle, name = tempfile.mkstemp(prefix=PREFIX, suffix=suffix, dir=folder)
        os.close(handle)
        return name

    return _begun(create)


def new_folder(folder: Path) -> Path:
    """A new, empty folder in `folder`. Whoever calls this calls `ended`.

    Raises:
        OSError: it cannot be created.
    """
    return _begun(lambda: tempfile.mkdtemp(prefix=PREFIX, dir=folder))


def ended(path: Path) -> None:
    """Remove a temporary file or folder, unless it has got another name."""
    with contextlib.suppress(OSError):  # where it cannot be removed, that is not what went wrong
        _remove(path)
    handle = _locks.pop(path, None)
    if handle is not None:
        os.close(handle)
    _say("-", path)


def remove_abandoned(folder: Path) -> None:
    """Remove the temporary files in `folder` whose owners were killed, with their guards."""
    for path in folder.glob(PREFIX + "*"):
        with contextlib.suppress(OSError):  # its owner lives, or it is not ours to remove
            handle = _locked(path)
            if handle is not None:
                _remove(path)
                os.close(handle)


def tell(pipe: int) -> None:
    """From now on, this process and those that inherit `pipe` tell of their files through it."""
    os.set_inheritable(pipe, True)
    os.environ[VARIABLE] = f"{pipe}:{os.fstat(pipe).st_ino}"


def inherited_pipe() -> tuple[int, ...]:
    """What a process has to pass on to one that it starts (`pass_fds`); empty without a guard."""
    descriptor, _, inode = os.environ.get(VARIABLE, "").partition(":")
    if not (descriptor.isdecimal() and inode.isdecimal()):
        return ()
    try:
        found = os.fstat(int(descriptor))
    except OSError:
        return ()
    ours = stat.S_ISFIFO(found.st_mode) and found.st_ino == int(inode)
    return (int(descriptor),) if ours else ()


def _begun(create: Callable[[], str]) -> Path:
    while True:
        path = Path(create())
        _say("+", path)
        # Before it is locked, another process may take it for abandoned.
        with contextlib.suppress(BlockingIOError, FileNotFoundError):
            handle = _locked(path)
            if path.exists():
                _locks[path] = handle
                return path
            if handle is not None:
                os.close(handle)


def _locked(path: Path) -> int | None:
    """A descriptor that locks `path`; None where the file system has no locks.

    Raises:
        BlockingIOError: another process has locked it.
        OSError: it cannot be opened.
    """
    if fcntl is None:
        return None
    # NFS locks only what is open for writing, and no folders.
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        raise
    except OSError:
        os.close(handle)
        return None
    return handle


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def _say(word: str, path: Path) -> None:
    for pipe in inherited_pipe():
        try:
            # A path is shorter than PIPE_BUF, so words of several processes do not mix.
            os.write(pipe, word.encode() + os.fsencode(path.absolute()) + b"\0")
        except OSError:
            # The guard is gone. What this process leaves is removed by `remove_abandoned`.
            return
