"""Why a scene file is refused, and what is said of one that is read with something left out."""

from collections import Counter


class SceneFileError(ValueError):
    """A rule that the file breaks: key, rule and value got. `read_scene` puts the file's name before it."""


# A message is for a terminal line; a file can hold a name of a megabyte.
_LONGEST = 400


def one_line(text: str, longest: int = _LONGEST) -> str:
    """`text` with whatever is unprintable (line breaks, control codes) escaped, cut to `longest`."""
    line = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text[: longest + 1])
    return line if len(line) <= longest else line[: longest - 1] + "…"


def label(name: str, fallback: str) -> str:
    """A name from a file, fit to be printed; `fallback` where it is empty."""
    return one_line(name, 80) or fallback


class Warnings:
    """Lines about what is ignored or approximated, each said once; like cases are counted."""

    def __init__(self) -> None:
        self._counts: Counter[tuple[str, str]] = Counter()

    def add(self, line: str) -> None:
        """Say `line`, once however often it is added."""
        self._counts[(line, line)] = 1

    def tally(self, one: str, many: str) -> None:
        """Count one more case: `one` is said of a single case, `many` of more, with {n} for how many."""
        self._counts[(one, many)] += 1

    def lines(self) -> tuple[str, ...]:
        """What is to be said, in the order it first came up."""
        return tuple(
            one_line(one if count == 1 else many.replace("{n}", str(count)))
            for (one, many), count in self._counts.items()
        )
