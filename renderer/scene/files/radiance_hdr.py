"""Radiance's .hdr images (RGBE): flat scanlines, and those with run lengths of each component.

Ward 1991, "Real Pixels" (Graphics Gems II), and Radiance's file format document ("Picture File Format").
"""

import re

import numpy as np
from jaxtyping import Float32, UInt8

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.limits import MAX_IMAGE_SIDE
from vpltune.renderer.scene.files.plain_numbers import plain_number

MOST_PIXELS = 1 << 23
"""A choice: 4096 × 2048. A hostile file needs about 2 s for each 10 million."""
# A choice: most bytes before the scanlines. Headers of real files have some hundreds.
_LONGEST_HEADER = 1 << 16
# Widths whose scanlines may have run lengths, as the format says.
_RUN_WIDTHS = range(8, 1 << 15)
# Pixels are mantissa · 2^(exponent − 136): 128 is the exponent of 1, and the mantissa has 8 bits.
_EXPONENT_OF_ONE = 136
_RESOLUTION = re.compile(rb"-Y ([0-9]{1,6}) \+X ([0-9]{1,6})")
# A code above this repeats one byte, any other is followed by that many bytes.
_LONGEST_LITERAL = 128


def hdr_pixels(content: bytes, where: str) -> Float32[np.ndarray, "height width 3"]:
    """Red, green and blue, row 0 at the top, divided by the file's EXPOSURE if there is one.

    Bytes after the last row are passed over, as in PLY, .glb and other images.

    Args:
        content: the file.
        where: its place or name, for messages.

    Raises:
        SceneFileError: the file is no such image, is too large or cut short, or has another form.
    """
    header, separator, _ = content[:_LONGEST_HEADER].partition(b"\n\n")
    if not separator or not header.startswith((b"#?RADIANCE", b"#?RGBE")):
        raise SceneFileError(f"{where}: is not a Radiance .hdr image")
    exposure = _exposure(header.split(b"\n")[1:], where)
    at = len(header) + len(separator)
    line, newline, _ = content[at : at + 40].partition(b"\n")
    found = _RESOLUTION.fullmatch(line)
    if found is None or not newline:
        raise SceneFileError(f"{where}: must have a line like -Y 512 +X 1024, got {_shown(line)}")
    height, width = int(found[1]), int(found[2])
    if not height or not width:
        raise SceneFileError(f"{where}: must have at least one pixel, got {width} × {height}")
    # The fewest bytes of a row: a marker of four, and 127 pixels of one component for each two.
    fewest = height * min(4 * width, 4 + 8 * -(-width // 127))
    if max(height, width) > MAX_IMAGE_SIDE or height * width > MOST_PIXELS:
        raise SceneFileError(
            f"{where}: must be at most {MAX_IMAGE_SIDE} pixels on a side and {MOST_PIXELS:,} in all, "
            f"got {width} × {height}"
        )
    at += len(line) + 1
    if len(content) - at < fewest:
        raise SceneFileError(f"{where}: is cut short: {width} × {height} pixels need more bytes")
    pixels = _rows(content, at, height, width, where)
    scale = np.ldexp(np.float32(1.0 / exposure), np.arange(256) - _EXPONENT_OF_ONE).astype(np.float32)
    # No exponent: black.
    scale[0] = 0.0
    return pixels[..., :3] * scale[pixels[..., 3]][..., None]


def _shown(text: bytes) -> str:
    return f"{text.decode('latin-1')!r:.60}"


def _exposure(lines: list[bytes], where: str) -> float:
    """The product of all EXPOSURE lines, by which pixels were multiplied."""
    exposure = 1.0
    for line in lines:
        key, equals, value = line.partition(b"=")
        if key == b"FORMAT" and value.strip() != b"32-bit_rle_rgbe":
            raise SceneFileError(f"{where}: FORMAT must be 32-bit_rle_rgbe, got {_shown(value)}")
        if key == b"EXPOSURE" and equals:
            try:
                exposure *= plain_number(value.decode("ascii", "replace"))
            except ValueError:
                exposure = 0.0
            # A choice: beyond these, a pixel that is left has no digits in single precision.
            if not 1e-12 <= exposure <= 1e12:
                raise SceneFileError(f"{where}: EXPOSURE must be from 1e-12 to 1e12, got {_shown(value)}")
    return exposure


def _rows(content: bytes, at: int, height: int, width: int, where: str) -> UInt8[np.ndarray, "h w 4"]:
    pixels = np.empty((height, width, 4), np.uint8)
    marker = bytes((2, 2, width >> 8, width & 255))
    for row in range(height):
        if width in _RUN_WIDTHS and content[at : at + 4] == marker:
            components, at = _unpacked(content, at + 4, width, where)
            pixels[row] = np.frombuffer(components, np.uint8).reshape(4, width).T
            continue
        flat = np.frombuffer(content[at : at + 4 * width], np.uint8)
        if flat.size < 4 * width:
            raise SceneFileError(f"{where}: is cut short in row {row}")
        pixels[row] = flat.reshape(width, 4)
        # No encoder writes a colour so: it is how whole pixels were repeated before 1991.
        if (pixels[row, :, :3] == 1).all(axis=1).any():
            raise SceneFileError(f"{where}: row {row} repeats whole pixels, which is not supported")
        at += 4 * width
    return pixels


def _unpacked(content: bytes, at: int, width: int, where: str) -> tuple[bytearray, int]:
    """The four components of a scanline, one after the other, and where the next scanline begins."""
    row = bytearray()
    length = len(content)
    for component in range(1, 5):
        end = component * width
        # Encoders join what is shorter than two bytes for each code on the average.
        codes_left = width // 2 + 2
        while len(row) < end:
            codes_left -= 1
            if at + 1 >= length or codes_left < 0:
                raise SceneFileError(f"{where}: is cut short, or broken, in its run lengths")
            code = content[at]
            if code > _LONGEST_LITERAL:
                row += content[at + 1 : at + 2] * (code - _LONGEST_LITERAL)
                at += 2
            else:
                row += content[at + 1 : at + 1 + code]
                at += 1 + code
        if len(row) != end:
            raise SceneFileError(f"{where}: is broken: a row has more pixels than the {width} of the image")
    return row, at
