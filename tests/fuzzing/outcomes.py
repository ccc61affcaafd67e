"""What may come of reading a file: it is read, it is refused in one line, and all else is a finding."""

import linecache
import re
import traceback
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from vpltune.renderer.errors import InputError, MachineError

Verdict = Literal["read", "refused", "finding"]
REPOSITORY = Path(__file__).resolve().parents[2]
"""Places in the code are given from here."""
_CODE = ("renderer", "vpltune", "tuner")
_EXPECTED_CAUSES = (OSError, ValueError, RecursionError)
"""What a refusal may stand for: a file that cannot be opened, or parsed, or nests too deep."""
_UNFORESEEN = re.compile(r"cannot be read \(\w+: ")
"""In the message where `reading_border` met an error that no reader foresaw. It names the error's type."""


@dataclass(frozen=True)
class Outcome:
    """What came of one case. Findings of the same `kind` are most likely one fault."""

    verdict: Verdict
    kind: str = ""
    message: str = ""


def judged(read: Callable[[Path], object], path: Path, mutated: bool) -> Outcome:
    """Read `path` and sort out what comes of it. What ends the process is left to who started it."""
    try:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            read(path)
    except (InputError, MachineError) as error:
        return _of_refusal(error, path, mutated)
    except Exception as error:
        return _finding(type(error).__name__, error)
    if said:
        first = said[0]
        kind = f"{first.category.__name__} at {_shown_place(first.filename, first.lineno)}"
        return Outcome("finding", kind, str(first.message)[:200])
    return Outcome("read")


def _of_refusal(error: Exception, path: Path, mutated: bool) -> Outcome:
    message = str(error)
    if isinstance(error.__cause__, MemoryError):
        return _finding("MemoryError, refused as too large", error.__cause__)
    if _is_unforeseen(error):
        cause = error.__cause__ or error
        return _finding(f"{type(cause).__name__}, refused as the file's fault", cause)
    if not mutated:
        return _finding("a valid file is refused", error)
    if len(message.splitlines()) != 1:
        return _finding("message of several lines", error)
    if not message.isprintable():
        return _finding("message of unprintable characters", error)
    if path.name not in message:
        return _finding("message without the file's name", error)
    if len(message) > _LONGEST_MESSAGE + len(str(path)):
        return _finding(f"message of more than {_LONGEST_MESSAGE} characters", error)
    return Outcome("refused")


def _is_unforeseen(error: Exception) -> bool:
    """Whether a fault of the reader became a refusal, as every error does at the readers' border."""
    is_expected = error.__cause__ is None or isinstance(error.__cause__, _EXPECTED_CAUSES)
    return not is_expected or _UNFORESEEN.search(str(error)) is not None


_LONGEST_MESSAGE = 1000
"""A choice: a few lines of a terminal."""


def _finding(kind: str, error: BaseException) -> Outcome:
    return Outcome("finding", f"{kind} at {_place(error)}", f"{type(error).__name__}: {error}"[:200])


def _place(error: BaseException) -> str:
    """The innermost line of ours that the error went through."""
    frames = [(frame.filename, frame.lineno or 0) for frame in traceback.extract_tb(error.__traceback__)]
    return place_of(frames[::-1])


def place_of(frames: list[tuple[str, int]]) -> str:
    """The first of the places, innermost first, that is in our code, shown with its text."""
    for file, line in frames:
        if is_ours(file):
            return _shown_place(file, line)
    return "no line of ours"


def is_ours(file: str) -> bool:
    """Whether a file is part of the code that is fuzzed."""
    return Path(file).is_relative_to(REPOSITORY) and _from_repository(file).parts[0] in _CODE


def _from_repository(file: str) -> Path:
    relative = Path(file).relative_to(REPOSITORY)
    # vpltune/renderer is a link to renderer.
    return Path(*relative.parts[1:]) if relative.parts[1:2] in (("renderer",), ("tuner",)) else relative


def _shown_place(file: str, line: int) -> str:
    if not is_ours(file):
        return f"{Path(file).name}:{line}"
    return f"{_from_repository(file)}:{line} `{linecache.getline(file, line).strip()[:60]}`"
