"""Options and errors of every command: `--quiet`, `--verbose`, and one line if an extra is not installed."""

import functools
import inspect
from collections.abc import Callable
from typing import Annotated, Any

import typer

from vpltune.cli.report import Report
from vpltune.cli.verbosity import choose_verbosity
from vpltune.renderer.errors import MachineError

QuietOption = Annotated[
    bool, typer.Option("-q", "--quiet", help="Print only errors on stderr: no progress, no notes.")
]
VerboseOption = Annotated[
    bool, typer.Option("-v", "--verbose", help="Print times, versions, drivers and tracebacks on stderr.")
]


def any_command(command: Callable[..., Report], name: str) -> Callable[..., Report]:
    """Decorate a command with `--quiet` and `--verbose`; a missing extra becomes an error of one line.

    typer reads the options from the signature of the command, so the signature is changed. The decorated
    command raises MachineError if it imports a package of an extra that is not installed.
    """

    @functools.wraps(command)
    def with_flags(*, quiet: bool, verbose: bool, **given: object) -> Report:
        choose_verbosity(quiet, verbose)
        try:
            return command(**given)
        except ImportError as error:
            # Imported here, because it is rarely needed.
            from vpltune.tuner.doctor.extras import extra_to_install, how_to_install

            extra = extra_to_install(error)
            if extra is None:
                raise
            raise MachineError(
                f"vpltune {name} needs vpltune[{extra}], which is not installed: {how_to_install(extra)}"
            ) from error

    flags = {"quiet": QuietOption, "verbose": VerboseOption}
    parameters = [
        *inspect.signature(command).parameters.values(),
        *(
            inspect.Parameter(flag, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=annotation)
            for flag, annotation in flags.items()
        ),
    ]
    # `Any`: the type of a function has no signature of its own to set.
    typed: Any = with_flags
    typed.__signature__ = inspect.Signature(parameters, return_annotation=Report)
    typed.__annotations__ = {each.name: each.annotation for each in parameters}
    return typed
