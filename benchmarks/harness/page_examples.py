"""Examples in pages: the commands after `$` in fenced blocks, and the numbers that they print."""

import re
from collections.abc import Iterator
from dataclasses import dataclass

EXAMPLE_NUMBER = re.compile(r"(?<![\w./×-])-?\d+(?:\.\d+)?(?:e[-+]\d+)?(?![\w.×²/-]| s\))")
"""A number in a command's output; no part of a name or of a size such as 320x240, and no seconds."""


@dataclass(frozen=True)
class Example:
    """A command and its output, as a page shows them."""

    command: str
    output: str
    start: int
    """Where the output stands in the page's text."""

    def numbers(self) -> list[tuple[int, str]]:
        """The numbers of the output, and where each stands in the page."""
        return [(self.start + match.start(), match[0]) for match in EXAMPLE_NUMBER.finditer(self.output)]


def examples(text: str) -> Iterator[Example]:
    """The examples of a page, in its order."""
    for block in re.finditer(r"^```\n(\$ .*?)^```$", text, re.MULTILINE | re.DOTALL):
        for part in re.finditer(r"^\$ (.*)\n((?:(?!\$ ).*\n)*)", block[1], re.MULTILINE):
            yield Example(part[1], part[2], block.start(1) + part.start(2))


def example_values(index: int, output: str) -> dict[str, float | None]:
    """The numbers that the example with this index printed, as `index.place`."""
    found = enumerate(Example("", output, 0).numbers())
    return {f"{index}.{place}": float(shown) for place, (_, shown) in found}
