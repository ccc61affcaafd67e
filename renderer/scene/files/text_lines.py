"""Lines of OBJ and MTL files, one at a time: a list of all lines would take ten times the file's memory."""

import io
import re
from collections.abc import Iterator

from vpltune.renderer.scene.files.diagnostics import SceneFileError

# A choice: longest line in bytes, continued ones together. A face of 2,000 corners takes at most 70 kB.
_LONGEST_LINE = 1 << 20
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def text_lines(content: bytes, where: str) -> Iterator[tuple[int, bytes]]:
    """Each line with its number, from 1. A backslash at its end joins it with the next, but not a comment.

    Lines end in a line feed, a carriage return, or both. A byte-order mark is passed over.

    Args:
        content: of the file.
        where: the file, for messages; empty for the scene file itself.

    Raises:
        SceneFileError: the content is no text in an encoding that keeps ASCII, or a line is too long.
    """
    prefix = where + ": " * bool(where)
    if b"\0" in content:
        raise SceneFileError(f"{prefix}must be text in UTF-8 or an eight-bit encoding")
    if b"\n" not in content:
        content = content.replace(b"\r", b"\n")
    stream = io.BytesIO(content)
    if content.startswith(_BYTE_ORDER_MARK):
        stream.seek(len(_BYTE_ORDER_MARK))
    parts: list[bytes] = []
    size, first = 0, 1
    for number, ended in enumerate(stream, 1):
        line = ended.rstrip(b"\r\n")
        size += len(line)
        if size > _LONGEST_LINE:
            raise SceneFileError(f"{prefix}line {first}: must have at most {_LONGEST_LINE:,} bytes")
        comment = not parts and line.lstrip().startswith(b"#")
        if line.endswith(b"\\") and not comment:
            parts.append(line[:-1])
            continue
        if parts:
            line = b" ".join([*parts, line])
            parts.clear()
        if b"\r" in line:
            for piece in line.split(b"\r"):
                yield first, piece
        else:
            yield first, line
        size, first = 0, number + 1
    if parts:
        yield first, b" ".join(parts)


def without_remark(line: bytes) -> bytes:
    """A line that ends in a name, without a comment. In `Material #25`, of 3ds Max, `#` begins none."""
    return re.split(rb"\s#(?=\s|$)", line, maxsplit=1)[0]


def first_word(line: bytes) -> tuple[bytes, str]:
    """The keyword of a line, and the rest as text without surrounding blanks."""
    words = line.split(None, 1)
    keyword = words[0] if words else b""
    return keyword, words[1].decode("utf-8", "replace").strip() if len(words) > 1 else ""
