"""The JSON of docs/test_vectors.json: rounded numbers, a row of them a line."""

import json
from typing import Any

import numpy as np

DIGITS = 9
"""Significant digits. A choice: two more than float32 has."""


def plain(value: Any) -> Any:
    """As JSON has it, numbers rounded to `DIGITS` digits."""
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if isinstance(value, bool | str) or value is None:
        return value
    if isinstance(value, int | np.integer):
        return int(value)
    # Zero has no sign, and what float64 left of it is zero.
    return float(f"{value:.{DIGITS}g}") if abs(value) > 1e-14 else 0.0


def json_text(value: Any, indent: int = 0) -> str:
    """JSON with one row of numbers a line."""
    flat = json.dumps(value, ensure_ascii=False)
    if not isinstance(value, dict | list) or len(flat) + indent <= 110:
        return flat
    inner = " " * (indent + 1)
    if isinstance(value, dict):
        items = [f"{inner}{json.dumps(key)}: {json_text(each, indent + 1)}" for key, each in value.items()]
        return "{\n" + ",\n".join(items) + "\n" + " " * indent + "}"
    items = [inner + json_text(each, indent + 1) for each in value]
    return "[\n" + ",\n".join(items) + "\n" + " " * indent + "]"
