"""Parser for PLY: the header, and the columns of its elements from ASCII or binary data."""

import re
import struct
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int64

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.limits import DecodedBytes

# PLY's scalar types as format characters of the struct module.
_TYPES = {
    "char": "b", "int8": "b", "uchar": "B", "uint8": "B", "short": "h", "int16": "h", "ushort": "H",
    "uint16": "H", "int": "i", "int32": "i", "uint": "I", "uint32": "I", "float": "f", "float32": "f",
    "double": "d", "float64": "d",
}  # fmt: skip
# Byte orders of the struct module by the name of the format; ASCII has none.
_BYTE_ORDERS: dict[str, Literal["<", ">", ""]] = {
    "binary_little_endian": "<",
    "binary_big_endian": ">",
    "ascii": "",
}
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
LONGEST_HEADER = 1 << 16
"""A choice: most bytes of a header."""
# A line of its own: comments may hold the word too.
_END_OF_HEADER = re.compile(rb"[\r\n](end_header)[ \t]*(?=[\r\n]|$)")
# A choice: bytes of ASCII data that are split at a time. A word takes 40 bytes of memory then.
_CHUNK = 1 << 20
# A choice: most characters of a number in ASCII data.
_LONGEST_NUMBER = 64


@dataclass(frozen=True)
class PlyProperty:
    """A scalar property, or a list if it has a `count_type`. Types are those of the struct module."""

    name: str
    type: str
    count_type: str = ""


@dataclass(frozen=True)
class PlyElement:
    """An element of the header, such as vertex or face: `count` rows of properties."""

    name: str
    count: int
    properties: list[PlyProperty] = field(default_factory=list)


@dataclass(frozen=True)
class PlyHeader:
    """A parsed header."""

    byte_order: Literal["<", ">", ""]
    """"<" or ">"; empty for ASCII."""
    elements: list[PlyElement]
    texture_name: str
    """The file in a TextureFile comment; empty if there is none."""
    size: int
    """Size of the header in bytes. The data follow it."""


@dataclass(frozen=True, eq=False)
class PlyColumn:
    """A property of all rows of an element. The lists of a list property are concatenated."""

    values: Float64[np.ndarray, " values"]
    type: str
    sizes: Int64[np.ndarray, " rows"] | None = None
    """Length of each row's list; None for a scalar property."""


def parse_ply_header(content: bytes) -> PlyHeader:
    """Parse the header at the start of a file.

    Raises:
        SceneFileError: the content does not start with a valid PLY header.
    """
    begin = len(_BYTE_ORDER_MARK) if content.startswith(_BYTE_ORDER_MARK) else 0
    ended = _END_OF_HEADER.search(content, begin, LONGEST_HEADER)
    if not content.startswith(b"ply", begin) or ended is None:
        raise SceneFileError("header: must begin with 'ply' and end with 'end_header'")
    end, size = ended.start(1), ended.end()
    size += 2 if content[size : size + 2] == b"\r\n" else 1
    byte_order, texture_name, elements = None, "", []
    for line in content[begin + 3 : end].decode("utf-8", "replace").splitlines():
        words = line.split()
        match words:
            case ["format", name, *_] if name in _BYTE_ORDERS:
                byte_order = _BYTE_ORDERS[name]
            case ["element", name, count] if count.isascii() and count.isdecimal() and len(count) < 13:
                elements.append(PlyElement(name, int(count)))
            case ["property", "list", count_type, type_, name] if elements and {count_type, type_} <= set(
                _TYPES
            ):
                elements[-1].properties.append(PlyProperty(name, _TYPES[type_], _TYPES[count_type]))
            case ["property", type_, name] if elements and type_ in _TYPES:
                elements[-1].properties.append(PlyProperty(name, _TYPES[type_]))
            case ["comment", "TextureFile", *_]:
                texture_name = line.split("TextureFile", 1)[1].strip()
            case [] | ["comment" | "obj_info", *_]:
                pass
            case _:
                raise SceneFileError(f"header: line {line!r:.80} is not understood")
    if byte_order is None:
        raise SceneFileError(
            "header: must have a format line: ascii, binary_little_endian or binary_big_endian"
        )
    return PlyHeader(byte_order, elements, texture_name, size)


class PlyData:
    """The data of a PLY file. Read its elements one by one in the header's order."""

    def __init__(self, content: bytes, header: PlyHeader, decoded: DecodedBytes) -> None:
        self._order = header.byte_order
        self._decoded = decoded
        self._at = 0
        self._source: bytes | np.ndarray = (
            content[header.size :] if header.byte_order else _ascii_numbers(content[header.size :], decoded)
        )

    @property
    def left(self) -> int:
        """Number of bytes (binary) or numbers (ASCII) not read yet."""
        return len(self._source) - self._at

    def read(self, element: PlyElement) -> dict[str, PlyColumn]:
        """The columns of the next element.

        Raises:
            SceneFileError: the data are cut off, or a list's length is negative, fractional or too large.
        """
        if not element.count or not element.properties:
            return {p.name: PlyColumn(np.empty(0), p.type, _no_rows(p)) for p in element.properties}
        # Every row has at least one number per property.
        least = element.count * sum(self._width(p.count_type or p.type) for p in element.properties)
        if least > self.left:
            raise SceneFileError(f"element '{element.name:.40}': its {element.count} rows are cut off")
        self._decoded.spend(8 * element.count * len(element.properties), f"element '{element.name:.40}'")
        columns = self._read_alike(element)
        return self._read_row_by_row(element) if columns is None else columns

    def _read_alike(self, element: PlyElement) -> dict[str, PlyColumn] | None:
        """All rows at once if all lists have the same lengths as in the first row, else None."""
        lengths, offset = [], self._at
        for p in element.properties:
            length = 1
            if p.count_type:
                length = self._number(offset, p.count_type, element)
                offset += self._width(p.count_type)
            lengths.append(length)
            offset += length * self._width(p.type)
        row = offset - self._at
        if row * element.count > self.left:
            return None
        columns, at = {}, self._at
        for p, length in zip(element.properties, lengths, strict=True):
            sizes = None
            if p.count_type:
                if (self._column(at, p.count_type, 1, row, element.count) != length).any():
                    return None
                at += self._width(p.count_type)
                sizes = np.full(element.count, length, np.int64)
                self._decoded.spend(8 * length * element.count, f"element '{element.name:.40}'")
            columns[p.name] = PlyColumn(
                self._column(at, p.type, length, row, element.count).ravel(), p.type, sizes
            )
            at += length * self._width(p.type)
        self._at += row * element.count
        return columns

    def _read_row_by_row(self, element: PlyElement) -> dict[str, PlyColumn]:
        sizes: dict[str, list[int]] = {p.name: [] for p in element.properties}
        values: dict[str, list[float]] = {p.name: [] for p in element.properties}
        # Python numbers take 40 bytes each, and there is at most one per byte of data.
        self._decoded.spend(min(40 * self.left, 1 << 62), f"element '{element.name:.40}'")
        for _ in range(element.count):
            for p in element.properties:
                length = 1
                if p.count_type:
                    length = self._number(self._at, p.count_type, element)
                    self._at += self._width(p.count_type)
                end = self._at + length * self._width(p.type)
                if end > len(self._source):
                    raise SceneFileError(
                        f"element '{element.name:.40}': its {element.count} rows are cut off"
                    )
                if isinstance(self._source, bytes):
                    values[p.name] += struct.unpack_from(
                        f"{self._order}{length}{p.type}", self._source, self._at
                    )
                else:
                    values[p.name] += self._source[self._at : end].tolist()
                sizes[p.name].append(length)
                self._at = end
        return {
            p.name: PlyColumn(
                np.array(values[p.name], np.float64),
                p.type,
                np.array(sizes[p.name], np.int64) if p.count_type else None,
            )
            for p in element.properties
        }

    def _width(self, type_: str) -> int:
        """Size of a number in the source: its bytes, or 1 for ASCII, where the source is an array."""
        return struct.calcsize(f"<{type_}") if self._order else 1

    def _number(self, at: int, type_: str, element: PlyElement) -> int:
        if at + self._width(type_) > len(self._source):
            raise SceneFileError(f"element '{element.name:.40}': its {element.count} rows are cut off")
        number = (
            struct.unpack_from(self._order + type_, self._source, at)[0]
            if isinstance(self._source, bytes)
            else self._source[at]
        )
        if not 0 <= number <= len(self._source) or number != int(number):
            raise SceneFileError(
                f"element '{element.name:.40}': a list's length must fit the file, got {number}"
            )
        return int(number)

    def _column(
        self, at: int, type_: str, length: int, row: int, count: int
    ) -> Float64[np.ndarray, "rows length"]:
        if not isinstance(self._source, bytes):
            rows = self._source[self._at : self._at + row * count].reshape(count, row)
            return rows[:, at - self._at : at - self._at + length]
        dtype = np.dtype(self._order + type_)
        return np.ndarray((count, length), dtype, self._source, at, (row, dtype.itemsize)).astype(np.float64)


def _no_rows(p: PlyProperty) -> Int64[np.ndarray, "0"] | None:
    return np.empty(0, np.int64) if p.count_type else None


def _ascii_numbers(body: bytes, decoded: DecodedBytes) -> Float64[np.ndarray, " numbers"]:
    # A number takes at least a digit and a blank. Memory that stays unused is never touched.
    decoded.spend(4 * len(body), "the data")
    numbers = np.empty(len(body) // 2 + 1)
    count = start = 0
    while start < len(body):
        end = start + _CHUNK
        # Not within a number, unless it is too long.
        end += len(body[end : end + _LONGEST_NUMBER + 1].split(None, 1)[0]) if _cuts_a_word(body, end) else 0
        words = body[start:end].split()
        longest = max(map(len, words), default=0)
        if longest > _LONGEST_NUMBER:
            raise SceneFileError(
                f"the data: a number must have at most {_LONGEST_NUMBER} characters, got {longest}"
            )
        try:
            if b"_" in body[start:end]:  # numpy reads 1_0 as 10
                raise ValueError("'_' is not part of a number")
            numbers[count : count + len(words)] = np.array(words, f"S{max(longest, 1)}").astype(np.float64)
        except ValueError as error:
            raise SceneFileError(f"the data: must be numbers ({error})") from error
        count += len(words)
        start = end
    return numbers[:count]


def _cuts_a_word(body: bytes, at: int) -> bool:
    return at < len(body) and not body[at - 1 : at].isspace() and not body[at : at + 1].isspace()
