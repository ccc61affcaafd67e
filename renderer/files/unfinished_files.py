"""Tells the process that guards this one which temporary files exist.

A process that is killed cannot remove its temporary files. Its guard (vpltune/guard.py) does it. It hears of
them through a pipe, which a process hands on to those that it starts with `inherited_pipe`.
"""

import os
import stat
from pathlib import Path

VARIABLE = "VPLTUNE_UNFINISHED_FILES"
"""Names the pipe in the environment, as `descriptor:inode`. The inode tells it from a file that has got its
descriptor in a process that did not inherit it."""


def tell(pipe: int) -> None:
    """From now on, this process and those that inherit `pipe` tell of their files through it."""
    os.set_inheritable(pipe, True)
    os.environ[VARIABLE] = f"{pipe}:{os.fstat(pipe).st_ino}"


def begun(path: Path) -> None:
    """A temporary file is about to be written."""
    _say("+", path)


def ended(path: Path) -> None:
    """A temporary file has got its name, or was removed."""
    _say("-", path)


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


def _say(word: str, path: Path) -> None:
    for pipe in inherited_pipe():
        try:
            # A path is shorter than PIPE_BUF, so words of several processes do not mix.
            os.write(pipe, word.encode() + os.fsencode(path.absolute()) + b"\0")
        except OSError:
            # The guard is gone, and nobody cleans up after a kill.
            return
