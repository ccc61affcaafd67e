"""EXT_meshopt_compression, mode ATTRIBUTES: elements as byte-wise differences in groups of 16.

The bitstream is specified in EXT_meshopt_compression, appendix A (Kapoulkine 2022).
"""

import numpy as np
from jaxtyping import Int64, UInt8

from vpltune.renderer.scene.files.diagnostics import SceneFileError

# All numbers are from the specification of the bitstream.
_HEADER = 0xA0
"""First byte of a stream of version 0."""
_GROUP = 16
"""Differences in a group."""
_BLOCK_BYTES = 8192
"""Most bytes of a decoded block."""
_LARGEST_BLOCK = 256
"""Most elements of a block."""
_SMALLEST_TAIL = 32
"""Least size in bytes of the tail, which ends with the baseline of the differences."""
_PACKED_BYTES = (0, 4, 8, 16)
"""Size in bytes of a group in modes 0 to 3: no bits (all zero), 2, 4 and 8 bits per difference."""


def decode_attributes(
    content: bytes, count: int, stride: int, where: str
) -> UInt8[np.ndarray, "count stride"]:
    """Decode `count` elements of `stride` bytes each.

    Args:
        content: the compressed stream.
        count: number of elements.
        stride: bytes per element, a multiple of 4 up to 256.
        where: the place in the file, for messages.

    Raises:
        SceneFileError: the stream has another mode or version, or is cut off.
    """
    tail = max(stride, _SMALLEST_TAIL)
    if len(content) < 1 + tail or content[0] != _HEADER:
        raise SceneFileError(f"{where}: must be an EXT_meshopt_compression stream of attributes, version 0")
    end = len(content) - tail
    modes, places, blocks = _groups(content, end, count, stride, where)
    # Vectorised reads of a group may go past its end, so pad the stream.
    stored = np.frombuffer(content + bytes(2 * _GROUP), np.uint8)
    differences = np.zeros((len(modes), _GROUP), np.uint8)
    for mode, bits in ((1, 2), (2, 4)):
        chosen = np.flatnonzero(modes == mode)
        differences[chosen] = _with_sentinels(stored, places[chosen], bits)
    chosen = np.flatnonzero(modes == 3)
    differences[chosen] = stored[places[chosen][:, None] + np.arange(_GROUP)]
    signed = (differences >> 1) ^ (np.uint8(0) - (differences & 1))
    elements = np.empty((count, stride), np.uint8)
    group = 0
    for first, size in blocks:
        groups = -(-size // _GROUP)
        columns = signed[group : group + groups * stride].reshape(stride, groups * _GROUP)
        elements[first : first + size] = columns[:, :size].T
        group += groups * stride
    np.cumsum(elements, axis=0, dtype=np.uint8, out=elements)
    return elements + np.frombuffer(content[len(content) - stride :], np.uint8)


def _groups(
    content: bytes, end: int, count: int, stride: int, where: str
) -> tuple[UInt8[np.ndarray, " groups"], Int64[np.ndarray, " groups"], list[tuple[int, int]]]:
    """Mode and offset of every group, and first element and size of every block.

    The length of a group depends on its content, so this walks through the whole stream.
    """
    sentinels = {bits: _sentinels_by_byte(bits) for bits in (2, 4)}
    largest = min(_BLOCK_BYTES // stride & ~(_GROUP - 1), _LARGEST_BLOCK)
    modes, places, blocks = bytearray(), [], []
    place = 1
    for first in range(0, count, largest):
        size = min(count - first, largest)
        blocks.append((first, size))
        groups = -(-size // _GROUP)
        for _ in range(stride):
            header = place
            place += -(-groups // 4)
            if place > end:
                raise SceneFileError(f"{where}: its EXT_meshopt_compression stream is cut off")
            for group in range(groups):
                mode = content[header + group // 4] >> 2 * (group % 4) & 3
                modes.append(mode)
                places.append(place)
                packed = _PACKED_BYTES[mode]
                extra = 0
                if mode in (1, 2):
                    extra = sum(map(sentinels[2 * mode].__getitem__, content[place : place + packed]))
                place += packed + extra
    if place > end:
        raise SceneFileError(f"{where}: its EXT_meshopt_compression stream is cut off")
    return np.frombuffer(bytes(modes), np.uint8), np.array(places, np.int64), blocks


def _sentinels_by_byte(bits: int) -> list[int]:
    """For each of the 256 bytes, how many of its differences have all bits set."""
    full = (1 << bits) - 1
    return [sum(byte >> shift & full == full for shift in range(0, 8, bits)) for byte in range(256)]


def _with_sentinels(
    stored: UInt8[np.ndarray, "bytes"], places: Int64[np.ndarray, " groups"], bits: int
) -> UInt8[np.ndarray, "groups 16"]:
    """Decode groups of 2 or 4 bits per difference. If all are set, the difference is a byte that follows."""
    packed = stored[places[:, None] + np.arange(2 * bits)]
    shifts = np.arange(8 - bits, -1, -bits, dtype=np.uint8)
    full = np.uint8((1 << bits) - 1)
    short = (packed[:, :, None] >> shifts & full).reshape(len(places), _GROUP)
    escaped = short == full
    following = places[:, None] + 2 * bits + np.cumsum(escaped, axis=1) - 1
    return np.where(escaped, stored[np.where(escaped, following, 0)], short)
