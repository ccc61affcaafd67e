"""Strict JSON: writing without NaN and Infinity, and reading without repeated keys."""

import json
import math
from collections.abc import Mapping
from typing import Any

# A choice: most characters of a place in a message, which is one line. Its end says more than its start.
_LONGEST_PLACE = 200


def strict_json(document: Mapping[str, Any], indent: int | None = 2) -> str:
    """`document` as JSON text. Numbers that are not finite become null, since JSON has none.

    Args:
        document: the values.
        indent: spaces per level; None writes one line.
    """
    return json.dumps(_finite(document), indent=indent, allow_nan=False)


class DuplicateKeyError(ValueError):
    """A key appears twice in one JSON object. The message is the key."""


def unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An `object_pairs_hook` for `json.loads` that rejects repeated keys. By default, the last one wins.

    Raises:
        DuplicateKeyError: a key appears twice.
    """
    members: dict[str, Any] = {}
    for key, value in pairs:
        if key in members:
            raise DuplicateKeyError(key)
        members[key] = value
    return members


class NotFiniteError(ValueError):
    """A number is NaN or infinite. The message is the number and the rule."""


def no_constant(name: str) -> float:
    """A `parse_constant` for `json.loads` that refuses NaN and Infinity, which Python reads by default.

    Raises:
        NotFiniteError: always.
    """
    raise NotFiniteError(f"{name} is not a JSON number")


def finite_float(text: str) -> float:
    """A `parse_float` for `json.loads` that refuses what Python reads as infinite, such as 1e999.

    Raises:
        NotFiniteError: it is too large.
    """
    value = float(text)
    if not math.isfinite(value):
        raise NotFiniteError(f"number {text:.40} is too large")
    return value


def not_finite_at(text: str | bytes) -> str:
    """The place of the first number that is not finite, such as `nodes[3].translation[0]`.

    Returns "the document" where the rest of the text is no JSON either.
    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return "the document"
    waiting: list[tuple[str, Any]] = [("", document)]
    while waiting:
        place, value = waiting.pop()
        if isinstance(value, float) and not math.isfinite(value):
            return place[-_LONGEST_PLACE:] or "the document"
        if isinstance(value, dict):
            waiting += [(_member(place, key), item) for key, item in reversed(value.items()) if _holds(item)]
        elif isinstance(value, list):
            last = len(value) - 1
            waiting += [
                (f"{place}[{last - i}]", item) for i, item in enumerate(reversed(value)) if _holds(item)
            ]
    return "the document"


def _member(place: str, key: str) -> str:
    if not key.isidentifier():
        return f"{place}[{key!r:.60}]"
    return f"{place}.{key:.60}" if place else f"{key:.60}"


def _holds(value: Any) -> bool:
    return isinstance(value, float | dict | list)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _finite(member) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(member) for member in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
