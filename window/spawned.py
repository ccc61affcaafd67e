"""Starts the processes of a window."""

import contextlib
import multiprocessing
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from multiprocessing.context import SpawnProcess
from types import ModuleType
from typing import Any

MAIN = "__main__"
"""The module of the program that runs (Python)."""


def spawned(
    target: Callable[..., None], arguments: tuple[Any, ...], *, name: str, daemon: bool
) -> tuple[SpawnProcess, Any]:
    """Start a process that calls `target`, and that SIGINT does not end.

    Args:
        target: a function of a module; called with the far end of the pipe and `arguments`.
        arguments: pickled.
        name: of the process.
        daemon: whether it ends with this process at the latest, and starts none itself.

    Returns:
        The process, and the near end of the pipe, which ends when the process has closed the far one.
    """
    # Spawned: a fork would inherit threads, sockets and OpenGL.
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=target, args=(theirs, *arguments), name=name, daemon=daemon)
    with _unknown_main_module(), _interrupts_ignored():
        process.start()
    # Ours to close: the pipe ends when the process has closed its own end.
    theirs.close()
    return process, ours


@contextlib.contextmanager
def _unknown_main_module() -> Iterator[None]:
    """While this lasts, spawned processes do not import the main module.

    They would run a user's script again, which opens a window in its turn, or look for a file called <stdin>.
    """
    main = sys.modules[MAIN]
    sys.modules[MAIN] = ModuleType(MAIN)
    try:
        yield
    finally:
        sys.modules[MAIN] = main


@contextlib.contextmanager
def _interrupts_ignored() -> Iterator[None]:
    """While this lasts, SIGINT is ignored, which started processes inherit.

    A terminal and a notebook send it to all processes. The one that was told ends the others, if they are to
    end. Only the main thread may set it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
