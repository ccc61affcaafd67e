"""The entry point: `vpltune`, also `python -m vpltune`. It loads nothing before signals are handled."""

import sys

from vpltune.guard import guarded

PROGRAM = "vpltune"


def main() -> None:
    """The entry point of the installed command."""
    sys.exit(guarded(_command, PROGRAM))


def _command() -> int:
    from vpltune.cli.program import main as run_command_line

    return run_command_line()


if __name__ == "__main__":
    main()
