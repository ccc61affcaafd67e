"""Tells when files change on disk."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Change = Literal["changed", "gone"]


@dataclass(frozen=True)
class _Stamp:
    inode: int
    bytes: int
    nanoseconds: int
    """Time of the last change."""


class WatchedFiles:
    """A set of files, looked at now and then.

    A file that is still being written looks changed again at the next look, so a change is told once the
    file has stayed the same between two looks.
    """

    def __init__(self) -> None:
        self._known: dict[Path, _Stamp | None] = {}
        self._suspected: dict[Path, _Stamp | None] = {}

    def watch(self, path: Path) -> None:
        """Watch a file, as it is now: also call it after writing the file oneself."""
        self._known[path] = _stamp(path)
        self._suspected.pop(path, None)

    def changes(self) -> list[tuple[Path, Change]]:
        """What has happened to the files since they were looked at."""
        told: list[tuple[Path, Change]] = []
        for path, known in self._known.items():
            now = _stamp(path)
            if now == known:
                self._suspected.pop(path, None)
            elif path in self._suspected and self._suspected[path] == now:
                del self._suspected[path]
                self._known[path] = now
                told.append((path, "gone" if now is None else "changed"))
            else:
                self._suspected[path] = now
        return told


def _stamp(path: Path) -> _Stamp | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return _Stamp(found.st_ino, found.st_size, found.st_mtime_ns)
