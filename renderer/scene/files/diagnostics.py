"""Errors and warnings of the scene readers, and the formatting of their messages."""

from collections import Counter


class SceneFileError(ValueError):
    """A scene file breaks a rule. The message names key, rule and value; `read_scene` prepends the file."""


# A choice: longest message in characters. It is for a terminal; a name in a file can be a megabyte long.
_LONGEST = 400


def one_line(text: str, longest: int = _LONGEST) -> str:
    """`text` with line breaks and other unprintable characters escaped, cut to `longest` characters."""
    line = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text[: longest + 1])
    return line if len(line) <= longest else line[: longest - 1] + "…"


def label(name: str, fallback: str) -> str:
    """A name from a file made printable, at most 80 characters; `fallback` if the name is empty."""
    return one_line(name, 80) or fallback


def mebibytes(count: int) -> str:
    """A number of bytes that is too large, in MiB: rounded up, so that it exceeds a limit of whole MiB."""
    return f"{-(-count >> 20):,} MiB"


class Warnings:
    """Collects lines about what is ignored or approximated. Each appears once; similar cases are counted."""

    def __init__(self) -> None:
        self._counts: Counter[tuple[str, str]] = Counter()

    def add(self, line: str) -> None:
        """Add a line. It appears once, however often it is added."""
        self._counts[(line, line)] = 1

    def tally(self, one: str, many: str) -> None:
        """Count a case. The line is `one` for a single case, else `many` with {n} replaced by the count."""
        self._counts[(one, many)] += 1

    def lines(self) -> tuple[str, ...]:
        """The lines, in the order in which they first came up."""
        return tuple(
            one_line(one if count == 1 else many.replace("{n}", str(count)))
            for (one, many), count in self._counts.items()
        )
