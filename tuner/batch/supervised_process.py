"""A tuning process under supervision: it is killed if it exceeds its limits of time or memory."""

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
from vpltune.renderer.files.unfinished_files import inherited_pipe
from vpltune.tuner.batch.job import Job
from vpltune.tuner.batch.messages import receive, send
from vpltune.tuner.batch.record import Record

START_SECONDS = 300.0
"""Time for Python and its libraries to load. A choice: it takes three seconds on an idle machine."""
LOOK_SECONDS = 0.2
"""Interval between two checks of the time and memory of the process. A choice."""
UNLIMITED_BYTES = 2**62
"""The memory limit that stands for none. A choice: more than any machine has."""
RENEWED_SHARE = 0.5
"""A process that uses more than this share of its memory limit is replaced before its next scene. A choice:
libraries cache what they compile, and those caches must not count against a later scene."""
RENEWED_BYTES = 4 * 2**30
"""The same in bytes, for large limits: the smaller of the two counts. A choice."""

Progress = Callable[[str, float], None]
"""Called with the stage of a fit and the share of it that is done, in [0, 1]."""


class StoppedError(Exception):
    """The batch was stopped, and the process with it."""


@dataclass(frozen=True)
class Limits:
    """Limits of one attempt at one scene, and the number of retries."""

    seconds: float
    """Wall time."""
    memory_bytes: int
    """Resident memory of the process and its children."""
    retries: int = 3
    """Further attempts after the first one failed."""


@dataclass(frozen=True)
class Attempt:
    """Result of one attempt: a record, a failure, or neither if another process is working on the scene."""

    record: Record | None
    failure: str
    """Reason of the failure; empty if there was none."""
    seconds: float
    """Wall time."""
    limit_passed: bool = False
    """Whether the attempt failed because it exceeded a limit."""


class SupervisedProcess:
    """A tuning process, started on demand and restarted after it died or was killed.

    Args:
        threads: Threads that each library in the process may use.
        stopped: Another thread sets it to end the process.
        module: The Python module that the process runs.
    """

    def __init__(
        self, threads: int, stopped: threading.Event, module: str = "vpltune.tuner.batch.tuning_process"
    ) -> None:
        self._threads = threads
        self._stopped = stopped
        self._module = module
        self._process: subprocess.Popen | None = None

    def attempt(self, job: Job, number: int, limits: Limits, progress: Progress) -> Attempt:
        """Let the process fit `job`, and wait for the result.

        Args:
            job: What to fit.
            number: Number of the attempt, from 1.
            limits: Limits of time and memory.
            progress: Called with each progress message of the fit.

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
        if answer.get("renew"):
            self.close()
        record = Record(**answer["record"]) if "record" in answer else None
        return Attempt(record, answer.get("failed", ""), seconds)

    def close(self) -> None:
        """Kill the process, if there is one, and all its children."""
        if self._process is None:
            return
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._connection.close()
        if self._process.stdin is not None:
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
                pass_fds=(theirs.fileno(), *inherited_pipe()),
                env={**os.environ, **thread_settings(self._threads)},
                start_new_session=True,  # own process group: killed as a whole, not reached by Ctrl-C
            )
        self._connection = Connection(ours.detach())

    def _answer(self, deadline: float, late: str, memory_bytes: int, progress: Progress) -> dict[str, Any]:
        """Wait for the next message that is not a progress report.

        Raises:
            _LimitPassedError: `deadline` passed, with `late` as its text, or more than `memory_bytes` were
                used.
            StoppedError: the batch was stopped.
            EOFError, OSError: the process died.
        """
        assert self._process is not None
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
                        f"it used {used / 2**20:.0f} MiB of memory, more than the limit of "
                        f"{memory_bytes / 2**20:.0f} MiB"
                    )

    def _renew_if_large_or_gone(self, limits: Limits) -> None:
        if self._process is not None:
            if self._process.poll() is not None:
                self.close()  # the process ended because it was idle for too long
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
            return f"its process was killed by {signal.Signals(-code).name}{said}"
        return f"its process ended with exit code {code}{said}"

    def _last_words(self) -> str:
        self._words.seek(0, os.SEEK_END)
        self._words.seek(max(0, self._words.tell() - 4096))
        lines = self._words.read().decode("utf-8", "replace").strip().splitlines()
        return f" ({lines[-1][:200]})" if lines else ""


class _LimitPassedError(Exception):
    """The attempt exceeded a limit; the text says which."""


def memory_of(process: psutil.Process) -> int:
    """Resident bytes of a process and all its children; 0 once the process is gone."""
    total = 0
    with contextlib.suppress(psutil.Error):
        for member in (process, *process.children(recursive=True)):
            with contextlib.suppress(psutil.Error):
                total += member.memory_info().rss
    return total


def machine_memory_bytes() -> int:
    """Total memory of this machine, or the limit of this process's container if that is lower."""
    total = psutil.virtual_memory().total
    with contextlib.suppress(OSError, ValueError):
        total = min(total, int(Path("/sys/fs/cgroup/memory.max").read_text()))
    return total


def thread_settings(threads: int) -> Mapping[str, str]:
    """Environment variables that limit JAX, llvmpipe, OpenMP and Dr.Jit to `threads` threads each."""
    return {
        "NPROC": str(threads),
        "LP_NUM_THREADS": str(threads if threads > 1 else 0),  # 0: only the caller's thread
        "OMP_NUM_THREADS": str(threads),
        "VPLTUNE_THREADS": str(threads),
    }
