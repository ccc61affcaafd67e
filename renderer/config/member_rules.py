"""Rules that members of a config's parts keep; each error names the member, the rule and the value."""

from collections.abc import Mapping
from typing import Any

from vpltune.renderer.errors import InputError


def known_members(values: Any, known: tuple[str, ...], where: str) -> dict[str, Any]:
    """The members of a JSON object.

    Raises:
        InputError: not an object, or a key that is not in `known`. `where` names the object.
    """
    if not isinstance(values, Mapping):
        raise InputError(f"{where}: must be an object, got {type(values).__name__}")
    for key in values:
        if key not in known:
            raise InputError(f"{where}: unknown key {key!r:.60}; known are {', '.join(known)}")
    return dict(values)


def whole_as_int(value: Any) -> Any:
    """A whole number that is written as a fraction, 24.0, as an int; anything else as it is."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def check_one_of(value: Any, allowed: tuple[int, ...], where: str, word: str | None = None) -> None:
    """Raise InputError unless `value` is one of `allowed`; `word` is named in it as one more."""
    if isinstance(value, bool) or not isinstance(value, int) or value not in allowed:
        names = ", ".join(([word] if word else []) + [str(each) for each in allowed])
        raise InputError(f"{where}: must be one of {names}, got {value!r:.60}")


def check_whole(value: Any, low: int, high: int, where: str, word: str | None = None) -> None:
    """Raise InputError unless `value` is an int in [low, high]; `word` is named in it as one more."""
    if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
        other = f'"{word}" or ' if word else ""
        raise InputError(f"{where}: must be {other}a whole number from {low} to {high}, got {value!r:.60}")


def check_number(value: Any, low: float, high: float, where: str) -> None:
    """Raise InputError unless `value` is a number in [low, high]."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    # False for NaN, and no conversion to float, which overflows on 10**400.
    if not number or not low <= value <= high:
        raise InputError(f"{where}: must be a number from {low:g} to {high:g}, got {value!r:.60}")
