"""Strict JSON: writing without NaN and Infinity, and reading without repeated keys."""

import json
import math
from collections.abc import Mapping
from typing import Any


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


def no_constant(name: str) -> float:
    """A `parse_constant` for `json.loads` that refuses NaN and Infinity, which Python reads by default.

    Raises:
        ValueError: always.
    """
    raise ValueError(f"{name} is not a JSON number")


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _finite(member) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(member) for member in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
