"""EXT_meshopt_compression, modes TRIANGLES and INDICES: indices coded relative to recent ones.

The bitstream is specified in EXT_meshopt_compression, appendix A (Kapoulkine 2022).
"""

import numpy as np
from jaxtyping import UInt32

from vpltune.renderer.scene.files.diagnostics import SceneFileError

# All numbers are from the specification of the bitstream.
_TRIANGLES_HEADER = 0xE1
"""First byte of a stream of triangles, version 1."""
_INDICES_HEADER = 0xD1
"""First byte of a stream of indices, version 1."""
_TRIANGLES_TAIL = 16
"""Bytes of the tail, a table of common codes."""
_INDICES_TAIL = 4
"""Bytes of the tail, which are padding."""
_WORD = 0xFFFFFFFF
"""Mask for arithmetic on 32-bit indices."""


def decode_triangles(content: bytes, count: int, where: str) -> UInt32[np.ndarray, " count"]:
    """Decode the `count` indices of a triangle list.

    Args:
        content: the compressed stream.
        count: number of indices, a multiple of 3.
        where: the place in the file, for messages.

    Raises:
        SceneFileError: the stream has another mode or version, is cut off, or is longer than its triangles.
    """
    codes_end = 1 + count // 3
    if len(content) < codes_end + _TRIANGLES_TAIL or content[0] != _TRIANGLES_HEADER:
        raise SceneFileError(f"{where}: must be an EXT_meshopt_compression stream of triangles, version 1")
    stream = _TriangleStream(content, codes_end)
    table = content[-_TRIANGLES_TAIL:]
    indices = np.empty((count // 3, 3), np.uint32)
    try:
        for triangle, code in enumerate(memoryview(content)[1:codes_end]):
            indices[triangle] = stream.by_edge(code) if code < 0xF0 else stream.by_vertices(code, table)
    except IndexError as error:
        raise SceneFileError(f"{where}: its EXT_meshopt_compression stream is cut off") from error
    if stream.place != len(content) - _TRIANGLES_TAIL:
        raise SceneFileError(f"{where}: its EXT_meshopt_compression stream must end after its last triangle")
    return indices.ravel()


def decode_indices(content: bytes, count: int, where: str) -> UInt32[np.ndarray, " count"]:
    """Decode `count` indices that are not a triangle list.

    Args:
        content: the compressed stream.
        count: number of indices.
        where: the place in the file, for messages.

    Raises:
        SceneFileError: the stream has another mode or version, or is cut off.
    """
    if len(content) < 1 + _INDICES_TAIL or content[0] != _INDICES_HEADER:
        raise SceneFileError(f"{where}: must be an EXT_meshopt_compression stream of indices, version 1")
    stream = _Varints(content[:-_INDICES_TAIL], 1)
    indices = np.empty(count, np.uint32)
    last = [0, 0]
    try:
        for place in range(count):
            value = stream.varint()
            baseline = value & 1
            last[baseline] = (last[baseline] + _signed(value >> 1)) & _WORD
            indices[place] = last[baseline]
    except IndexError as error:
        raise SceneFileError(f"{where}: its EXT_meshopt_compression stream is cut off") from error
    return indices


def _signed(zigzag: int) -> int:
    return ~(zigzag >> 1) if zigzag & 1 else zigzag >> 1


class _Varints:
    """Sequential reader of bytes and varints. It raises IndexError at the end."""

    def __init__(self, content: bytes, place: int) -> None:
        self._content = content
        self.place = place

    def byte(self) -> int:
        """The next byte."""
        self.place += 1
        return self._content[self.place - 1]

    def varint(self) -> int:
        """The next 32-bit unsigned LEB128 number."""
        value = 0
        for shift in range(0, 35, 7):
            byte = self.byte()
            value |= (byte & 0x7F) << shift
            if byte < 0x80:
                break
        return value & _WORD


class _TriangleStream(_Varints):
    """State of the triangle decoder: ring buffers of the last 16 edges and vertices."""

    def __init__(self, content: bytes, place: int) -> None:
        super().__init__(content, place)
        self._next = 0
        self._last = 0
        self._edges = [(0, 0)] * 16
        self._vertices = [0] * 16
        self._edge_count = 0
        self._vertex_count = 0

    def by_edge(self, code: int) -> tuple[int, int, int]:
        """A triangle of a recent edge and a vertex that is new, recent, or coded as a difference."""
        a, b = self._edges[self._edge_count - 1 - (code >> 4) & 15]
        choice = code & 15
        if choice == 0:
            c = self._new()
        elif choice < 0xD:
            c = self._recent(choice)
        elif choice < 0xF:
            c = self._last = self._last + (1 if choice == 0xE else -1) & _WORD
        else:
            c = self._coded()
        if choice == 0 or choice >= 0xD:
            self._push_vertex(c)
        self._push_edges((c, b), (a, c))
        return a, b, c

    def by_vertices(self, code: int, table: bytes) -> tuple[int, int, int]:
        """A triangle of three vertices, each new, recent, or coded as a difference."""
        explicit = code >= 0xFE
        choices = self.byte() if explicit else table[code & 15]
        if explicit and choices == 0:
            self._next = 0
        a = self._coded() if code == 0xFF else self._new()
        second, third = choices >> 4, choices & 15
        b = self._chosen(second, explicit)
        c = self._chosen(third, explicit)
        self._push_vertex(a)
        for choice, vertex in ((second, b), (third, c)):
            if choice == 0 or (explicit and choice == 15):
                self._push_vertex(vertex)
        self._push_edges((b, a), (c, b), (a, c))
        return a, b, c

    def _chosen(self, choice: int, explicit: bool) -> int:
        if choice == 0:
            return self._new()
        return self._coded() if explicit and choice == 15 else self._recent(choice - 1)

    def _new(self) -> int:
        self._next += 1
        return self._next - 1 & _WORD

    def _coded(self) -> int:
        self._last = self._last + _signed(self.varint()) & _WORD
        return self._last

    def _recent(self, age: int) -> int:
        return self._vertices[self._vertex_count - 1 - age & 15]

    def _push_vertex(self, vertex: int) -> None:
        self._vertices[self._vertex_count & 15] = vertex
        self._vertex_count += 1

    def _push_edges(self, *edges: tuple[int, int]) -> None:
        for edge in edges:
            self._edges[self._edge_count & 15] = edge
            self._edge_count += 1
