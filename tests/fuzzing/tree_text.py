"""Trees as JSON or TOML, also those that are neither and that the libraries refuse to write."""

import json
import math
from typing import Any

from tests.fuzzing.extremes import Nested, Raw, SecondKey


def json_text(value: Any) -> str:
    """A tree as JSON, with its marks."""
    if isinstance(value, dict):
        return (
            "{" + ",".join(f"{json.dumps(_name(key))}:{json_text(each)}" for key, each in value.items()) + "}"
        )
    if isinstance(value, list):
        return "[" + ",".join(map(json_text, value)) + "]"
    if isinstance(value, Raw):
        return value.text
    if isinstance(value, Nested):
        return value.text('{"a":')
    return json.dumps(value)


def toml_text(document: dict[Any, Any]) -> str:
    """A tree as TOML, with its marks. Lists of tables below the top are written as [[tables]]."""
    values, tables = [], []
    for key, value in document.items():
        if isinstance(value, dict) and value:
            tables.append(f"[{_toml_key(key)}]\n{_toml_lines(value)}")
        elif isinstance(value, list) and value and all(isinstance(each, dict) for each in value):
            tables += [f"[[{_toml_key(key)}]]\n{_toml_lines(each)}" for each in value]
        else:
            values.append(f"{_toml_key(key)} = {_toml_value(value)}\n")
    return "".join(values) + "\n".join(tables)


def _toml_lines(table: dict[Any, Any]) -> str:
    return "".join(f"{_toml_key(key)} = {_toml_value(value)}\n" for key, value in table.items())


def _toml_value(value: Any) -> str:
    if isinstance(value, dict):
        members = (f"{_toml_key(key)} = {_toml_value(each)}" for key, each in value.items())
        return "{" + ", ".join(members) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(_toml_value, value)) + "]"
    if isinstance(value, Raw):
        return value.text
    if isinstance(value, Nested):
        return value.text("{a=")
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # TOML writes nan and inf as Python does
    # None is no value of TOML: it is left to be refused. Surrogates stay as they are and become broken UTF-8.
    return json.dumps(value, ensure_ascii=False)


def _toml_key(key: Any) -> str:
    name = _name(key)
    plain = name.isascii() and name.replace("_", "").replace("-", "").isalnum()
    return name if plain else json.dumps(name, ensure_ascii=False)


def _name(key: Any) -> str:
    return key.name if isinstance(key, SecondKey) else str(key)
