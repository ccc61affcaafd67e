"""The command line that was typed, for the provenance of files."""

import shlex
from contextvars import ContextVar

command_arguments: ContextVar[tuple[str, ...]] = ContextVar("command_arguments", default=())
"""The arguments of the command that is running."""


def command_line() -> str:
    """The running command, quoted for a shell."""
    return shlex.join(("vpltune", *command_arguments.get()))
