"""Ends a command on a signal: at once, with one line, and with nothing half-written left behind.

Libraries of a command hold the interpreter for seconds at a time: OpenGL for a frame, XLA for a loop, and all
of them while they are imported. Python's own handlers wait for that. So the command runs in a child process.
Its parent, the guard, has loaded nothing: it hears the signal, kills the child and whatever the child has
started, and removes their temporary files. All other files are written whole (renderer/files/atomic_file.py),
so a command may be killed at any moment. One that has something to say at its end asks for time
(`asked_to_stop`).
"""

import contextlib
import os
import select
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

PATIENCE_SECONDS = 1.5
"""Time that a command gets that has something to say. A choice: all is over within two seconds."""
_ENDINGS: dict[int, str] = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
if hasattr(signal, "SIGHUP"):
    _ENDINGS[signal.SIGHUP] = "the terminal has gone"
_MEANT = (signal.SIGINT, signal.SIGTERM)
"""Signals that end a command even if they were ignored when it started."""
_ASKS, _SPEAKS = b"?", b"!"
"""Words of the child: it wants to be asked to stop; it has printed its last line."""
_SHOW_CURSOR = "\x1b[?25h"
"""Ends a progress display, which hides the cursor (ECMA-48, DECTCEM)."""
_STDERR = 2
"""The last of the descriptors that every process has open (POSIX)."""
_DIE_WITH_PARENT = 1
"""PR_SET_PDEATHSIG of Linux's prctl."""

_pipe_to_guard: int | None = None
"""Descriptor through which this process, the child, speaks to its guard; None without a guard."""


def guarded(command: Callable[[], int], name: str) -> int:
    """Run `command` in a child process and return its exit code, or 128 + N if signal N ended it.

    Call it before anything is imported that starts threads. It returns in the child too. Where there is no
    fork, as on Windows, the command runs in this process.
    """
    if not hasattr(os, "fork"):
        return command()
    _open_standard_streams()
    signals, wake = os.pipe()
    os.set_blocking(wake, False)
    signal.set_wakeup_fd(wake)
    # Signals are read from the pipe. Without a handler, Python would act on them itself. nohup ignores that
    # of the terminal, which stays so. A shell script ignores SIGINT for what it starts in the background;
    # whoever sends it to such a command all the same means it.
    heeded = [each for each in _ENDINGS if each in _MEANT or signal.getsignal(each) is not signal.SIG_IGN]
    for each in (*heeded, signal.SIGCHLD):
        signal.signal(each, _ignored)
    words, speak = os.pipe()
    guard = os.getpid()
    child = os.fork()
    if child == 0:
        signal.set_wakeup_fd(-1)
        for descriptor in (signals, wake, words):
            os.close(descriptor)
        _die_with(guard)
        return _child(command, speak, heeded)
    os.close(speak)
    code = _Guard(child, name, signals, words).wait()
    for each in heeded:
        signal.signal(each, signal.SIG_IGN)  # all is said: another one must not change the exit code
    return code


@contextlib.contextmanager
def asked_to_stop(stop: Callable[[], None] | None = None) -> Iterator[None]:
    """While this lasts, a signal calls `stop`, and the command has `PATIENCE_SECONDS` to end.

    Args:
        stop: called between two steps of the interpreter; None raises KeyboardInterrupt.
    """
    if _pipe_to_guard is None:
        yield
        return

    def asked(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGUSR1, _ignored)
        if stop is None:
            raise KeyboardInterrupt
        stop()

    before = signal.signal(signal.SIGUSR1, asked)
    os.write(_pipe_to_guard, _ASKS + b"\0")
    try:
        yield
    finally:
        signal.signal(signal.SIGUSR1, before)


def last_line_printed() -> None:
    """Tell the guard that nothing is left to be said of an interruption."""
    if _pipe_to_guard is not None:
        with contextlib.suppress(OSError):
            os.write(_pipe_to_guard, _SPEAKS + b"\0")


def _ignored(number: int, frame: FrameType | None) -> None:
    """A handler, and not SIG_IGN, which programs that the command starts would inherit."""


def _child(command: Callable[[], int], speak: int, heeded: list[int]) -> int:
    global _pipe_to_guard
    from vpltune.renderer.files import unfinished_files

    _pipe_to_guard = speak
    unfinished_files.tell(speak)
    # A terminal sends SIGINT to both; the guard alone acts on it.
    for number in (signal.SIGCHLD, *heeded):
        if number != signal.SIGINT:
            signal.signal(number, signal.SIG_DFL)
    return command()


def _open_standard_streams() -> None:
    """Put the null device in place of streams that were closed, or the next pipe would be taken for one."""
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= _STDERR:
        os.set_inheritable(descriptor, True)
    os.close(descriptor)


def _die_with(guard: int) -> None:
    """End this process when its guard is killed; elsewhere than on Linux it goes on to its end."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
        if os.getppid() != guard:  # it was killed before
            os._exit(128 + signal.SIGKILL)


class _Guard:
    """The parent of a command.

    Args:
        child: process id of the command.
        name: name of the program, for its one line.
        signals: descriptor that a byte comes from for each signal.
        words: descriptor that the child and its processes speak through.
    """

    def __init__(self, child: int, name: str, signals: int, words: int) -> None:
        self._child, self._name = child, name
        self._signals, self._words = signals, words
        self._open = [signals, words]
        self._heard = b""
        self._unfinished: set[bytes] = set()
        self._asks = self._spoken = False

    def wait(self) -> int:
        """The exit code of the command."""
        ended_by = None
        while (status := self._status()) is None:
            for number in self._received(None):
                ended_by = ended_by or number
            if ended_by is not None:
                status = self._stopped()
                break
        self._listen()
        self._remove_unfinished()
        code = os.waitstatus_to_exitcode(status)
        if code >= 0 and (ended_by is None or code == 0):
            return code  # perhaps it was done when the signal came
        ended_by = ended_by or -code
        if not self._spoken:
            self._say(_ENDINGS.get(ended_by) or _cause_of_death(ended_by))
        return 128 + ended_by

    def _status(self) -> int | None:
        ended, status = os.waitpid(self._child, os.WNOHANG)
        return status if ended else None

    def _received(self, seconds: float | None) -> list[int]:
        """Signals that end the command and have come, after waiting for any for `seconds` at most."""
        readable, _, _ = select.select(self._open, [], [], seconds)
        if self._words in readable:
            self._hear()
        if self._signals not in readable:
            return []
        return [number for number in os.read(self._signals, 4096) if number in _ENDINGS]

    def _stopped(self) -> int:
        """Stop the command, and return its status."""
        self._listen()
        if self._asks:
            import time

            with contextlib.suppress(ProcessLookupError):
                os.kill(self._child, signal.SIGUSR1)
            until = time.monotonic() + PATIENCE_SECONDS
            while (left := until - time.monotonic()) > 0.0:
                if (status := self._status()) is not None:
                    return status
                if self._received(left):
                    break  # asked twice
        # The command first, or it would say that one of the others has failed.
        for process in (self._child, *_descendants(self._child)):
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        return os.waitpid(self._child, 0)[1]

    def _listen(self) -> None:
        while self._words in self._open and select.select([self._words], [], [], 0.0)[0]:
            self._hear()

    def _hear(self) -> None:
        heard = os.read(self._words, 65536)
        if not heard:
            self._open.remove(self._words)  # the child has closed its end
            return
        *said, self._heard = (self._heard + heard).split(b"\0")
        for word in said:
            if word[:1] == b"+":
                self._unfinished.add(word[1:])
            elif word[:1] == b"-":
                self._unfinished.discard(word[1:])
            self._asks |= word == _ASKS
            self._spoken |= word == _SPEAKS

    def _remove_unfinished(self) -> None:
        for each in self._unfinished:
            path = Path(os.fsdecode(each))
            with contextlib.suppress(OSError):
                if path.is_dir():
                    import shutil

                    shutil.rmtree(path, ignore_errors=True)
                path.unlink(missing_ok=True)

    def _say(self, line: str) -> None:
        if sys.stderr is None:
            return
        with contextlib.suppress(OSError, ValueError):
            before = _SHOW_CURSOR + "\n" if sys.stderr.isatty() else ""
            print(f"{before}{self._name}: {line}", file=sys.stderr, flush=True)


def _cause_of_death(number: int) -> str:
    reason = "; the machine may be out of memory" if number == signal.SIGKILL else ""
    return f"its process was killed by {signal.Signals(number).name}{reason}"


def _descendants(process: int) -> list[int]:
    """Process ids of all that a process has started, and of what these have started; empty without /proc."""
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError, ValueError, IndexError):
            # The second field, a name in brackets, may hold spaces and brackets of its own.
            parent = int(entry.read_bytes().rpartition(b")")[2].split()[1])
            parents.setdefault(parent, []).append(int(entry.parent.name))
    found = [process]
    for each in found:
        found += parents.get(each, [])
    return found[1:]
