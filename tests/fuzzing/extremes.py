"""Values at the edges of what a file can hold, and marks in a tree for what no value of Python is."""

import math
import random
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Raw:
    """A value by its text, such as 1e999, which Python would write as Infinity."""

    text: str


@dataclass(frozen=True)
class Nested:
    """A value inside `depth` lists or objects; the writers write it without recursion."""

    depth: int
    in_objects: bool

    def text(self, object_opening: str) -> str:
        """The value as text.

        Args:
            object_opening: how an object with one key begins, up to the key's value.
        """
        opening, closing = (object_opening, "}") if self.in_objects else ("[", "]")
        return opening * self.depth + "1" + closing * self.depth


class SecondKey:
    """A key that is written like `name` but is another one to a dict: it makes a key appear twice."""

    def __init__(self, name: str) -> None:
        self.name = name


NUMBERS: tuple[Any, ...] = (
    *(0, -1, 1, 2, 3, 4, 5, 7, 8, 64, 127, 128, 255, 256, 32767, 65535, 65536, 1_000_000, 10_000_000),
    *(2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**53, 2**53 + 1, 2**63 - 1, 2**63, 2**64, -(2**31), -(2**63)),
    *(0.5, -0.5, -0.0, 1.0, 1.5, 1e-320, 1e-45, 1e-30, 1e-15, 1e-7, 0.9999999, 1.0000001),
    *(1e15, 1e18, 1e19, 1e30, 1.1e30, 3.5e38, 1e155, 1e300, -1e15, -1e30, -1e300),
    *(math.nan, math.inf, -math.inf, Raw("1e999"), Raw("-1e999"), Raw("1e-999")),
    *(10**30, 10**40, Raw("1" + "0" * 400), Raw("9" * 5000), Raw("0" * 50 + "1"), Raw("+1"), Raw("0x10")),
)
"""Ends of the ranges of integers and floats, denormals, and spellings that formats differ on."""

STRINGS: tuple[str, ...] = (
    *(
        "",
        " ",
        "\0",
        "a\0b",
        "\ud800",
        "a\udfffb",
        "\ud83d\udca1",
        "💡",
        "\u2028",
        "\x85",
        "\x1b[31m",
        "\ufeff",
    ),
    *("a\nb", "\r\n", "\t", '"', "\\", "'", "]]>", "<!--", "#", "{n}", "{0}", "%s%n", "$a", "${a}", "*"),
    *(".", "..", "../x", "/etc/passwd", "/dev/zero", "/dev/stdin", "a/" * 3000, "a" * 300, "a" * 70_000),
    *(
        "data:",
        "data:,",
        "data:;base64",
        "data:;base64,AAAA",
        "data:;base64,%%%",
        "data:image/png;base64,AAA",
    ),
    *(
        "%00",
        "%ff",
        "%ed%a0%80",
        "%",
        "file:///etc/hosts",
        "http://[",
        "http://localhost:1/x",
        "//x",
        "C:\\x",
    ),
    *(
        "nan",
        "NaN",
        "inf",
        "-inf",
        "1e999",
        "1e-320",
        "0x1p3",
        "1_000",
        "١٢",
        "²",
        "-0",
        "1,2",
        "0;0",
        "1 2 3",
    ),
)
"""Texts that are no Unicode, no path, no number or part of a format's own grammar."""

ODD_CHARACTERS = (
    "\ud800",
    "\udfff",
    "\0",
    "\n",
    "\u2028",
    "\x1b",
    "💡",
    "/",
    "\\",
    "%",
    "%00",
    "'",
    '"',
    " ",
)
"""Characters that make a valid name, path or number one that is not, or that is hard to print."""

LONGEST_TEXT = 1 << 21
"""A choice: characters that a repeated part of a document may come to, so that cases are made in no time."""

DEPTHS = (10, 63, 64, 65, 300, 990, 1100, 5000, 100_000)
"""Depths of nesting around the limits of readers and of Python's own recursion."""


def extreme(rng: random.Random) -> Any:
    """A value of any type, mostly a number or a text."""
    choice = rng.randrange(12)
    if choice < 5:
        return rng.choice(NUMBERS)
    if choice < 8:
        return rng.choice(STRINGS)
    if choice == 8:
        return Nested(rng.choice(DEPTHS), rng.random() < 0.5)
    empty: tuple[Any, ...] = (
        None,
        True,
        False,
        [],
        {},
        [[]],
        [{}],
        {"": 0},
        [None],
        Raw("1979-05-27T07:32:00Z"),
    )
    return rng.choice(empty)


def number_text(rng: random.Random) -> str:
    """A number as a text format writes it, or a word that is none."""
    value = rng.choice(NUMBERS) if rng.random() < 0.8 else rng.choice(STRINGS)
    return value.text if isinstance(value, Raw) else str(value)
