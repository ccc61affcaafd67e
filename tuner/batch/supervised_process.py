"""A tuning process under supervision: within its limits of time and memory, or gone."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import psutil

from vpltune.renderer.errors import MachineError
from vpltune.tuner.batch.job import Job
from vpltune.tuner.batch.messages import receive, send
from vpltune.tuner.batch.record import Record

START_SECONDS = 300.0
"""For Python and its libraries to load: three on a quiet machine."""
LOOK_SECONDS = 0.2
"""Between two looks at the clock and at the memory of the process."""
UNLIMITED_BYTES = 2**62
RENEWED_SHARE = 0.5
"""Of the memory limit, above which a process is replaced before its next scene: libraries keep what they
compiled, and their caches must not be charged to a scene that comes late."""
RENEWED_BYTES = 4 * 2**30
"""The same, where the limit is large."""

Progress = Callable[[str, float], None]


class StoppedError(Exception):
    """The batch was stopped, and the process with it."""


@dataclass(frozen=True)
class Limits:
    """What one attempt at one scene may take, and how often it is made again."""

    seconds: float
    memory_bytes: int
    retries: int = 3


@dataclass(frozen=True)
class Attempt:
    """How one attempt ended: with a record, with a failure, or with neither where another process has it."""

    record: Record | None
    failure: str
    seconds: float
    limit_passed: bool = False


class SupervisedProcess:
    """A tuning process that is started when needed, and anew after it died or was stopped.

    `threads`: how many each library in it may use. `stopped`: ends whatever runs, from another thread.
    """

    def __init__(
        self, threads: int, stopped: threading.Event, module: str = "vpltune.tuner.batch.tuning_process"
    ) -> None:
        self._threads = threads
        self._stopped = stopped
        self._module = module
        self._process: subprocess.Popen | None = None

    def attempt(self, job: Job, number: int, limits: Limits, progress: Progress) -> Attempt:
        """Let the process fit `job`.

        Raises:
            MachineError: this machine cannot fit anything.
            StoppedError: `stopped` was set.
        """
        self._renew_if_large_or_gone(limits)
        started = time.perf_counter()
        try:
            if self._process is None:
                self._start()
                late = f"its process was not ready within {START_SECONDS:g} s"
                self._answer(started + START_SECONDS, late, limits.memory_bytes, progress)
                started = time.perf_counter()
            send(self._connection, {"job": job.to_json(), "attempt": number})
            late = f"it took longer than the limit of {limits.seconds:g} s"
            answer = self._answer(started + limits.seconds, late, limits.memory_bytes, progress)
        except _LimitPassedError as failed:
            self.close()
            return Attempt(None, str(failed), time.perf_counter() - started, limit_passed=True)
        except (EOFError, OSError):
            return Attempt(None, self._cause_of_death(), time.perf_counter() - started)
        except BaseException:
            self.close()
            raise
        seconds = time.perf_counter() - started
        if "machine_error" in answer:
            raise MachineError(answer["machine_error"])
        record = Record(**answer["record"]) if "record" in answer else None
        return Attempt(record, answer.get("failed", ""), seconds)

    def close(self) -> None:
        """End the process and all that it started."""
        if self._process is None:
            return
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._connection.close()
        self._process.stdin.close()
        self._words.close()
        self._process = None

    def _start(self) -> None:
        ours, theirs = socket.socketpair()
        self._words = tempfile.TemporaryFile()  # noqa: SIM115  closed with the process
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", self._module, str(theirs.fileno())],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=self._words,
                pass_fds=(theirs.fileno(),),
                env={**os.environ, **thread_settings(self._threads)},
                start_new_session=True,  # a group of its own: it is ended whole, and by nobody's Ctrl-C
            )
        self._connection = Connection(ours.detach())

    def _answer(self, deadline: float, late: str, memory_bytes: int, progress: Progress) -> dict[str, Any]:
        """The next message that is more than progress."""
        process = psutil.Process(self._process.pid)
        looked = 0.0
        while True:
            if self._connection.poll(LOOK_SECONDS):
                message = receive(self._connection)
                if "stage" not in message:
                    return message
                progress(message["stage"], message["share"])
            now = time.perf_counter()
            if self._stopped.is_set():
                raise StoppedError
            if now > deadline:
                raise _LimitPassedError(late)
            if now - looked > LOOK_SECONDS:
                looked = now
                if (used := memory_of(process)) > memory_bytes:
                    raise _LimitPassedError(
                        f"it took {used / 2**20:.0f} MiB of memory, more than the limit of "
                        f"{memory_bytes / 2**20:.0f} MiB"
                    )

    def _renew_if_large_or_gone(self, limits: Limits) -> None:
        if self._process is not None:
            if self._process.poll() is not None:
                self.close()  # it had nothing to do for long
                return
            with contextlib.suppress(psutil.Error):
                most = min(RENEWED_SHARE * limits.memory_bytes, RENEWED_BYTES)
                if memory_of(psutil.Process(self._process.pid)) > most:
                    self.close()

    def _cause_of_death(self) -> str:
        process = self._process
        assert process is not None
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=10.0)
        code, said = process.poll(), self._last_words()
        self.close()
        if code is not None and code < 0:
            return f"its process died of {signal.Signals(-code).name}{said}"
        return f"its process ended with exit code {code}{said}"

    def _last_words(self) -> str:
        self._words.seek(0, os.SEEK_END)
        self._words.seek(max(0, self._words.tell() - 4096))
        lines = self._words.read().decode("utf-8", "replace").strip().splitlines()
        return f" ({lines[-1][:200]})" if lines else ""


class _LimitPassedError(Exception):
    """The attempt is over: a limit was passed."""


def memory_of(process: psutil.Process) -> int:
    """Resident bytes of a process and all that it started; 0 once it is gone."""
    total = 0
    with contextlib.suppress(psutil.Error):
        for member in (process, *process.children(recursive=True)):
            with contextlib.suppress(psutil.Error):
                total += member.memory_info().rss
    return total


def machine_memory_bytes() -> int:
    """Memory that this machine, or the container that this process is in, has."""
    total = psutil.virtual_memory().total
    with contextlib.suppress(OSError, ValueError):
        total = min(total, int(Path("/sys/fs/cgroup/memory.max").read_text()))
    return total


def thread_settings(threads: int) -> Mapping[str, str]:
    """Environment variables that keep JAX, llvmpipe, OpenMP and Dr.Jit to so many threads each."""
    return {
        "NPROC": str(threads),
        "LP_NUM_THREADS": str(threads if threads > 1 else 0),  # 0: no threads beside the caller's own
        "OMP_NUM_THREADS": str(threads),
        "VPLTUNE_THREADS": str(threads),
    }
