"""How much is said on stderr: `--quiet`, `--verbose`, or neither of them. Errors are always said."""

import logging
import sys
from typing import Literal

from vpltune.renderer.errors import InputError

Verbosity = Literal["quiet", "normal", "verbose"]

_chosen: Verbosity = "normal"


def reset_verbosity() -> None:
    """As if neither flag was given."""
    _choose("normal")


def choose_verbosity(quiet: bool, verbose: bool) -> None:
    """What one place of the command line says; the flags stand before the command or after it.

    Raises:
        InputError: both flags are given.
    """
    if (quiet or is_quiet()) and (verbose or is_verbose()):
        raise InputError("--quiet and --verbose: only one of them can be given")
    if quiet or verbose:
        _choose("quiet" if quiet else "verbose")


def is_quiet() -> bool:
    """Whether stderr gets errors alone."""
    return _chosen == "quiet"


def is_verbose() -> bool:
    """Whether stderr gets times, versions, drivers and tracebacks."""
    return _chosen == "verbose"


def say(text: object) -> None:
    """Print a line on stderr, unless `--quiet`."""
    if not is_quiet():
        print(f"vpltune: {one_line(text)}", file=sys.stderr, flush=True)


def detail(text: object) -> None:
    """Print a line on stderr with `--verbose`."""
    if is_verbose():
        say(text)


def one_line(text: object) -> str:
    """`text` with every run of white space made one space."""
    return " ".join(str(text).split())


class _DetailHandler(logging.Handler):
    """Prints what the library logs as a line of ours."""

    def emit(self, record: logging.LogRecord) -> None:
        detail(record.getMessage())


_LOG = logging.getLogger("vpltune")
_LOG_LEVELS = {"quiet": logging.ERROR, "normal": logging.NOTSET, "verbose": logging.DEBUG}
_DETAIL_HANDLER = _DetailHandler()


def _choose(verbosity: Verbosity) -> None:
    global _chosen
    _chosen = verbosity
    _LOG.setLevel(_LOG_LEVELS[verbosity])
    _LOG.removeHandler(_DETAIL_HANDLER)
    if verbosity == "verbose":
        _LOG.addHandler(_DETAIL_HANDLER)
