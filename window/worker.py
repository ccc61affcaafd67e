"""A process of the window, and the pipe that it and the server speak through."""

import asyncio
import contextlib
from collections.abc import Callable
from typing import Any

from vpltune.window.spawned import spawned


class Worker:
    """A spawned process, whose messages arrive in the event loop.

    Args:
        name: of the process, for messages.
        target: a function of a module that can be imported; called with the pipe's other end and `arguments`.
        arguments: pickled.
        received: called in the loop with each message.
        ended: called in the loop once, with the exit code, when the process has ended by itself.
    """

    def __init__(
        self,
        name: str,
        target: Callable[..., None],
        arguments: tuple[Any, ...],
        received: Callable[[Any], None],
        ended: Callable[[int | None], None],
    ):
        self._process, self._connection = spawned(target, arguments, name=name, daemon=True)
        self._received, self._ended = received, ended
        self._loop = asyncio.get_running_loop()
        self.name = name
        self._loop.add_reader(self._connection.fileno(), self._read)
        self._open = True

    def send(self, message: Any) -> None:
        """Send a message; nothing happens if the process has ended, which `ended` tells of."""
        if self._open:
            with contextlib.suppress(OSError):
                self._connection.send(message)

    def stop(self) -> None:
        """End the process at once, without a call of `ended`. Whatever it writes, it writes whole."""
        if self._open:
            self._close()
            self._process.kill()
            # Reaped, so that it does not stay as a zombie; killed, it ends within moments.
            self._loop.run_in_executor(None, self._process.join)

    def _read(self) -> None:
        try:
            while self._connection.poll():
                self._received(self._connection.recv())
                if not self._open:
                    return
        except (EOFError, OSError):
            self._close()
            self._process.join(timeout=1.0)
            self._ended(self._process.exitcode)

    def _close(self) -> None:
        self._open = False
        self._loop.remove_reader(self._connection.fileno())
        self._connection.close()
