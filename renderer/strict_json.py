"""JSON that every reader takes: numbers that are not finite become null."""

import json
import math
from collections.abc import Mapping
from typing import Any


def strict_json(document: Mapping[str, Any]) -> str:
    """`document` as indented JSON text without NaN or Infinity, which JSON has no words for."""
    return json.dumps(_finite(document), indent=2, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _finite(member) for key, member in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(member) for member in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    return value
