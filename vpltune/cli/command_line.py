"""What was typed, for the record that a command leaves of itself."""

import shlex
from contextvars import ContextVar

command_arguments: ContextVar[tuple[str, ...]] = ContextVar("command_arguments", default=())
"""The arguments of the command that is running."""


def command_line() -> str:
    """The running command as a shell takes it."""
    return shlex.join(("vpltune", *command_arguments.get()))
