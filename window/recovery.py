"""Unsaved changes outlive the window: they are kept in the user's cache until they are saved."""

import contextlib
import hashlib
from pathlib import Path

from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.cache_folder import cache_folder
from vpltune.renderer.files.small_text import read_small_text
from vpltune.window.document import Edited
from vpltune.window.saving import recovered, recovery_text

LARGEST_FILE = 1 << 24
"""Bytes of a file of unsaved changes. A choice: a thousand lights take a third of a megabyte."""


class Recovery:
    """The unsaved changes of one scene.

    Args:
        scene: the scene's file; None keeps nothing.
    """

    def __init__(self, scene: Path | None):
        self._path: Path | None = None
        if scene is not None:
            name = hashlib.sha256(str(scene.resolve()).encode("utf-8", "surrogateescape")).hexdigest()[:24]
            self._path = cache_folder() / "window" / f"{name}.json"

    def keep(self, now: Edited) -> None:
        """Write the changes down. A cache that cannot be written to is not worth a word."""
        if self._path is not None:
            with contextlib.suppress(InputError, MachineError, OSError):
                write_text_whole(self._path, recovery_text(now))

    def forget(self) -> None:
        """All is saved."""
        if self._path is not None:
            with contextlib.suppress(OSError):
                self._path.unlink(missing_ok=True)

    def left(self, now: Edited) -> Edited | None:
        """The changes that the last window did not save; None if there are none, or they cannot be read."""
        if self._path is None or not self._path.is_file():
            return None
        try:
            return recovered(read_small_text(self._path, LARGEST_FILE), str(self._path), now)
        except InputError:
            return None
