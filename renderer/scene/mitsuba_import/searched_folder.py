"""The folders in which a Mitsuba scene looks for files: those of its <path> elements, then its own."""

from pathlib import Path

from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings
from vpltune.renderer.scene.files.scene_folder import SceneFolder

MOST_PATHS = 32
"""A choice: most <path> elements. Each file is looked for in all of them."""


class SearchedFolder(SceneFolder):
    """A scene's folder with search paths, which must be in that folder or below too."""

    def __init__(self, scene_path: Path) -> None:
        super().__init__(scene_path)
        self._search: list[str] = []

    def search_first(self, relative: str, where: str, warnings: Warnings) -> None:
        """Look for files in `relative` before all folders named until now, as Mitsuba does.

        Raises:
            SceneFileError: there are too many search paths.
        """
        if len(self._search) == MOST_PATHS:
            raise SceneFileError(f"{where}: a scene must have at most {MOST_PATHS} search paths")
        try:
            is_folder = super()._inside(relative, where).is_dir()
        except SceneFileError:
            warnings.add(f"search path {relative!r:.60} is not inside the scene's folder; it is passed over")
            return
        if is_folder:
            self._search.insert(0, relative)
        else:
            warnings.add(f"search path {relative!r:.60} is not a folder; it is passed over")

    def found(self, relative: str, where: str) -> Path:
        """Where a file is, or would be in the scene's own folder if there is none.

        Raises:
            SceneFileError: the path leads out of the scene's folder.
        """
        return self._inside(relative, where)

    def _inside(self, relative: str, where: str) -> Path:
        for folder in self._search:
            try:
                found = super()._inside(f"{folder}/{relative}", where)
            except SceneFileError:
                continue
            if found.is_file():
                return found
        return super()._inside(relative, where)
