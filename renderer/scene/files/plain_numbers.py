"""Numbers in text as file formats mean them. Python itself also reads 1_0, ١ and infinity."""

import math

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.limits import LARGEST_NUMBER


def plain_number(word: str | bytes) -> float:
    """The number that a word writes in ASCII digits.

    Raises:
        ValueError: the word is no number, has an underscore or other digits, is not finite, or too large.
    """
    text = word if isinstance(word, bytes) else word.encode("ascii")
    number = math.nan if b"_" in text else float(text)
    if not abs(number) <= LARGEST_NUMBER:
        raise ValueError(f"not a finite number: {word!r:.40}")
    return number


def plain_index(word: bytes) -> int:
    """The whole number that a word writes in ASCII digits, with or without a sign.

    Raises:
        ValueError: the word is no whole number, has an underscore, or does not fit 32 bits.
    """
    # Longer ones fit only with zeros in front; Python would take quadratic time for thousands of digits.
    if b"_" in word or len(word) > 40:
        raise ValueError(f"not a whole number: {word!r:.40}")
    number = int(word)
    if not -(1 << 31) < number < 1 << 31:
        raise ValueError(f"does not fit 32 bits: {word!r:.40}")
    return number


def finite_numbers(words: list[bytes], count: int, what: str) -> list[float]:
    """The first `count` words as numbers.

    Args:
        words: of a line.
        count: how many are needed; there may be more.
        what: line and keyword, for messages.

    Raises:
        SceneFileError: there are fewer, or one of them is not finite.
    """
    try:
        numbers = [plain_number(word) for word in words[:count]]
    except ValueError:
        numbers = []
    if len(numbers) < count:
        shown = b" ".join(words[:count]).decode("utf-8", "replace")
        raise SceneFileError(f"{what}: must be {count} finite numbers, got {shown!r:.60}")
    return numbers
