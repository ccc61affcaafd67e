"""JSON that every reader takes: numbers that are not finite become null."""

import json
import math
from collections.abc import Mapping
from typing import Any


def strict_json(document: Mapping[str, Any], indent: int | None = 2) -> str:
    """`document` as JSON text without NaN or Infinity, which JSON lacks; `indent` None: in one line."""
    return json.dumps(_finite(document), indent=indent, allow_nan=False)


class DuplicateKeyError(ValueError):
    """A key appears twice in one JSON object. Its text is the key."""


def unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """The `object_pairs_hook` of a strict reader: the standard one keeps the last of two equal keys.

    Raises:
        DuplicateKeyError: two keys are equal.
    """
    members: dict[str, Any] = {}
    for key, value in pairs:
        if key in members:
            raise DuplicateKeyError(key)
        members[key] = value
    return members


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _finite(member) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(member) for member in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
