"""How much is printed on stderr, by `--quiet` and `--verbose`. Errors are always printed."""

import logging
import sys
from typing import Literal

from vpltune.renderer.errors import InputError

Verbosity = Literal["quiet", "normal", "verbose"]

_chosen: Verbosity = "normal"


def reset_verbosity() -> None:
    """Return to the verbosity without flags."""
    _choose("normal")


def choose_verbosity(quiet: bool, verbose: bool) -> None:
    """Set the verbosity by the flags at one place of the command line, before the command or after it.

    Raises:
        InputError: both flags are given, at one place or at two.
    """
    if (quiet or is_quiet()) and (verbose or is_verbose()):
        raise InputError("--quiet and --verbose: only one of them can be given")
    if quiet or verbose:
        _choose("quiet" if quiet else "verbose")


def is_quiet() -> bool:
    """Whether only errors are printed."""
    return _chosen == "quiet"


def is_verbose() -> bool:
    """Whether times, versions, drivers and tracebacks are printed."""
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
    """`text` with each run of white space replaced by one space."""
    return " ".join(str(text).split())


class _DetailHandler(logging.Handler):
    """Prints log messages of the library as lines of `detail`."""

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
