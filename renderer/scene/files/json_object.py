"""Strict parsing of untrusted JSON, and typed access to its values."""

import json
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.files.strict_json import (
    DuplicateKeyError,
    NotFiniteError,
    finite_float,
    no_constant,
    not_finite_at,
    unique_keys,
)
from vpltune.renderer.scene.files.diagnostics import SceneFileError, mebibytes
from vpltune.renderer.scene.files.limits import LARGEST_NUMBER, MAX_JSON_BYTES, MAX_JSON_VALUES


@dataclass(frozen=True, slots=True)
class JsonObject:
    """A JSON object and its place in the document.

    The getters return a typed value by key. If the key is absent, they return the default, if there is one.
    They raise SceneFileError with place and value if the value has the wrong type or is out of range, or if
    the key is absent and there is no default.
    """

    members: dict[str, Any]
    where: str
    """The place, such as `meshes[3].primitives[0]`; empty for the whole document."""

    def at(self, key: str) -> str:
        """The place of a member in the document, for messages."""
        return f"{self.where}.{key}" if self.where else key

    def object(self, key: str) -> "JsonObject | None":
        """An object; None if the key is absent."""
        if key not in self.members:
            return None
        return _as_object(self.members[key], self.at(key))

    def required_object(self, key: str) -> "JsonObject":
        """An object."""
        return _as_object(self._required(key), self.at(key))

    def objects(self, key: str) -> "JsonObjects":
        """A list of objects; empty if the key is absent."""
        return JsonObjects(self._list(key), self.at(key))

    def extension(self, name: str) -> "JsonObject | None":
        """The object `extensions.<name>` of glTF; None if it is absent."""
        extensions = self.object("extensions")
        return None if extensions is None else extensions.object(name)

    def string(self, key: str, default: str | None = None) -> str:
        """A string."""
        if key not in self.members and default is not None:
            return default
        value = self._required(key)
        if not isinstance(value, str):
            raise self._wrong(key, "a string", value)
        return value

    def strings(self, key: str) -> list[str]:
        """A list of strings; empty if the key is absent."""
        values = self._list(key)
        for value in values:
            if not isinstance(value, str):
                raise self._wrong(key, "a list of strings", value)
        return values

    def boolean(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self.members.get(key, default)
        if not isinstance(value, bool):
            raise self._wrong(key, "true or false", value)
        return value

    def integer(self, key: str, default: int | None = None, low: int = 0, high: int | None = None) -> int:
        """A whole number from `low` to `high`. A float without a fraction counts as whole."""
        value = default if key not in self.members and default is not None else self._required(key)
        whole = _whole(value)
        if whole is None or whole < low or (high is not None and whole > high):
            bounds = f"of at least {low}" if high is None else f"from {low} to {high}"
            raise self._wrong(key, f"a whole number {bounds}", value)
        return whole

    def index(self, key: str, length: int, of: str) -> int | None:
        """An index into a list of that length, which messages call `of`; None if the key is absent."""
        if key not in self.members:
            return None
        return as_index(self.members[key], self.at(key), length, of)

    def required_index(self, key: str, length: int, of: str) -> int:
        """An index into a list of that length, which messages call `of`."""
        return as_index(self._required(key), self.at(key), length, of)

    def indices(self, key: str, length: int, of: str) -> list[int]:
        """Indices into a list of that length, which messages call `of`; empty if the key is absent."""
        if key not in self.members:
            return []
        place = self.at(key)
        return [as_index(item, f"{place}[{i}]", length, of) for i, item in enumerate(self._list(key))]

    def number(
        self, key: str, default: float | None = None, low: float = -math.inf, high: float = math.inf
    ) -> float:
        """A finite number from `low` to `high`."""
        value = default if key not in self.members and default is not None else self._required(key)
        if not _is_number(value) or not low <= value <= high:
            bounds = "" if low == -math.inf and high == math.inf else f" from {low:g} to {high:g}"
            raise self._wrong(key, f"a finite number{bounds}", value)
        return float(value)

    def numbers(
        self, key: str, count: int, default: Sequence[float] | None = None
    ) -> Float64[np.ndarray, " count"]:
        """A list of `count` finite numbers."""
        value = default if key not in self.members and default is not None else self._required(key)
        if not isinstance(value, list | tuple) or len(value) != count or not all(map(_is_number, value)):
            raise self._wrong(key, f"a list of {count} finite numbers", value)
        return np.array(value, np.float64)

    def _list(self, key: str) -> list[Any]:
        value = self.members.get(key, [])
        if not isinstance(value, list):
            raise self._wrong(key, "a list", value)
        return value

    def _required(self, key: str) -> Any:
        if key not in self.members:
            raise SceneFileError(f"{self.where or 'the document'}: key '{key}' is missing")
        return self.members[key]

    def _wrong(self, key: str, rule: str, value: Any) -> SceneFileError:
        return SceneFileError(f"{self.at(key)}: must be {rule}, got {shown(value)}")


class JsonObjects:
    """A list of JSON objects. Each is checked and wrapped when it is asked for.

    Many members refer into one long list, so taking the list again must not cost its length.
    """

    __slots__ = ("_members", "_where")

    def __init__(self, members: list[Any], where: str) -> None:
        self._members = members
        self._where = where

    def __len__(self) -> int:
        return len(self._members)

    def __getitem__(self, index: int) -> JsonObject:
        """The object with that index.

        Raises:
            SceneFileError: this member is not an object.
        """
        return _as_object(self._members[index], f"{self._where}[{index}]")

    def __iter__(self) -> Iterator[JsonObject]:
        return (self[index] for index in range(len(self)))


def parse_json(content: bytes) -> JsonObject:
    """Parse a JSON document whose top-level value is an object.

    Raises:
        SceneFileError: the content is not JSON in UTF-8, a key appears twice in one object, a number is not
            finite in double precision, nesting is too deep, or the text or its values are too many.
    """
    # The number of commas and opening brackets is an upper bound for the number of values.
    if sum(content.count(mark) for mark in (b",", b"{", b"[")) > MAX_JSON_VALUES:
        raise SceneFileError(f"the document: must hold at most {MAX_JSON_VALUES:,} JSON values")
    try:
        text = content.decode("utf-8-sig")  # glTF lets a reader ignore a byte order mark
        # One wide character makes Python keep every character of the text in up to four bytes.
        if sys.getsizeof(text) > MAX_JSON_BYTES:
            raise SceneFileError(
                f"the document: JSON must take at most {MAX_JSON_BYTES >> 20} MiB as text, "
                f"got {mebibytes(sys.getsizeof(text))}; put large buffers into a .glb or .bin"
            )
        document = json.loads(
            text,
            object_pairs_hook=unique_keys,
            parse_constant=no_constant,
            parse_float=finite_float,
        )
    except SceneFileError:
        raise
    except DuplicateKeyError as error:
        raise SceneFileError(f"the document: key {str(error)!r:.60} appears twice in one object") from error
    except RecursionError as error:
        raise SceneFileError("the document: JSON is nested too deep") from error
    except NotFiniteError as error:
        raise SceneFileError(f"{not_finite_at(text)}: {error}") from error
    except ValueError as error:
        raise SceneFileError(f"the document: is not JSON ({error})") from error
    return _as_object(document, "")


def as_index(value: Any, where: str, length: int, of: str) -> int:
    """`value` as an index into a list of that length, which the message calls `of`.

    Raises:
        SceneFileError: the value is not a whole number from 0 to `length` − 1.
    """
    whole = _whole(value)
    if whole is None or not 0 <= whole < length:
        raise SceneFileError(f"{where}: must be an index into the {length} {of}, got {shown(value)}")
    return whole


def shown(value: Any) -> str:
    """Any value as a short text for messages."""
    if isinstance(value, dict | list | tuple) and len(value) > 16:
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)} members"
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > 10**30:
        return f"a whole number of {value.bit_length()} bits"
    if isinstance(value, dict | list | tuple):
        return f"{type(value)(value)!r:.60}" if all(_is_plain(v) for v in value) else "nested values"
    return f"{value!r:.60}"


def _is_plain(value: Any) -> bool:
    return isinstance(value, str | float | bool | None) or (isinstance(value, int) and abs(value) < 10**30)


def _as_object(value: Any, where: str) -> JsonObject:
    if not isinstance(value, dict):
        raise SceneFileError(f"{where or 'the document'}: must be an object, got {shown(value)}")
    return JsonObject(value, where)


def _is_number(value: Any) -> bool:
    # In Python, bool is a subclass of int.
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST_NUMBER


def _whole(value: Any) -> int | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    # Beyond 2**53 a double cannot represent every whole number.
    return int(value) if value == value // 1 and abs(value) <= 2**53 else None
