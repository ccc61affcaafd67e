"""Restricted file access: regular files of bounded size inside the scene's folder."""

import os
import stat
from pathlib import Path

from vpltune.renderer.scene.files.diagnostics import SceneFileError, mebibytes
from vpltune.renderer.scene.files.limits import MAX_FILE_BYTES


class SceneFolder:
    """The folder of a scene file. Files that the scene refers to are read from here and nowhere else."""

    def __init__(self, scene_path: Path) -> None:
        self._root = scene_path.parent.resolve()
        self._left = MAX_FILE_BYTES

    def read_scene_file(self, path: Path) -> bytes:
        """The bytes of the scene file itself. The user named it, so it may be a link to anywhere.

        Raises:
            SceneFileError: the file is missing, not regular, unreadable or too large.
        """
        return self._read(path, "")

    def read(self, relative: str, where: str) -> bytes:
        """The bytes of a file that the scene refers to.

        Args:
            relative: path relative to the folder.
            where: the place of the reference, for messages.

        Raises:
            SceneFileError: the path leads out of the folder, also by a link, or the file is missing, not
                regular or unreadable, or all files read so far are too large together.
        """
        return self._read(self._inside(relative, where), f"{where}: {relative!r:.80} ")

    def has(self, relative: str, where: str) -> bool:
        """Whether `relative` exists inside the folder.

        Raises:
            SceneFileError: the path leads out of the folder.
        """
        return self._inside(relative, where).exists()

    def _inside(self, relative: str, where: str) -> Path:
        shown = f"{relative!r:.80}"
        if not relative or "\0" in relative:
            raise SceneFileError(f"{where}: must name a file in the scene's folder, got {shown}")
        if _is_plain(relative) and not self._is_link(relative):
            return self._root / relative
        try:
            resolved = (self._root / relative).resolve()
        except (OSError, RuntimeError) as error:  # too long a name; a loop of links (Python < 3.13)
            raise SceneFileError(f"{where}: {shown} cannot be opened ({_cause(error)})") from error
        if not resolved.is_relative_to(self._root):
            raise SceneFileError(f"{where}: must stay inside the scene's folder, got {shown}")
        return resolved

    def _is_link(self, name: str) -> bool:
        """Whether a name in the folder is, or may be, a link. A look takes a tenth of resolving a path."""
        try:
            return stat.S_ISLNK(os.lstat(f"{self._root}{os.sep}{name}").st_mode)
        except FileNotFoundError:
            return False
        except OSError:
            return True

    def _read(self, path: Path, subject: str) -> bytes:
        try:
            # Check before opening: opening a device can have side effects, and opening a FIFO blocks.
            if not stat.S_ISREG(path.stat().st_mode):
                raise SceneFileError(f"{subject}is not a regular file")
            handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
            with os.fdopen(handle, "rb") as file:
                found = os.fstat(handle)
                if not stat.S_ISREG(found.st_mode):
                    raise SceneFileError(f"{subject}is not a regular file")
                if found.st_size > self._left:
                    raise SceneFileError(
                        f"{subject}has {mebibytes(found.st_size)}, and all files of a scene together must "
                        f"have at most {MAX_FILE_BYTES >> 20} MiB"
                    )
                content = file.read(found.st_size)
        except OSError as error:
            raise SceneFileError(f"{subject}cannot be read ({_cause(error)})") from error
        self._left -= len(content)
        return content


def _is_plain(relative: str) -> bool:
    return Path(relative).name == relative and relative != os.pardir


def _cause(error: Exception) -> str:
    return (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
