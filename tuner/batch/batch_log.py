"""The log of a batch: one JSON object per line. Read it with `pandas.read_json(path, lines=True)`."""

import datetime
import fcntl
import os
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from vpltune.renderer.files.strict_json import strict_json

TAIL_BYTES = 1 << 16
"""Bytes read from the end of the log to find its last whole line. A choice: longer than any line."""


class BatchLog:
    """Appends whole lines to a log file. Several runs may append to the same file at once."""

    def __init__(self, path: Path) -> None:
        self._handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o644)

    def __enter__(self) -> "BatchLog":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._handle)

    def write(self, event: Mapping[str, Any]) -> None:
        """Append `event`, preceded by the current time (ISO 8601, UTC)."""
        now = datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds")
        line = strict_json({"time": now, **event}, indent=None).encode() + b"\n"
        fcntl.flock(self._handle, fcntl.LOCK_EX)
        try:
            self._drop_torn_line()
            os.write(self._handle, line)
        finally:
            fcntl.flock(self._handle, fcntl.LOCK_UN)

    def _drop_torn_line(self) -> None:
        """Truncate the partial last line that a killed process left."""
        size = os.fstat(self._handle).st_size
        if size == 0 or os.pread(self._handle, 1, size - 1) == b"\n":
            return
        start = max(0, size - TAIL_BYTES)
        end = os.pread(self._handle, TAIL_BYTES, start).rfind(b"\n")
        os.ftruncate(self._handle, start + end + 1)
