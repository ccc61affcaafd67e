"""Read the output folder of a batch: its scenes and their records."""

from dataclasses import dataclass
from pathlib import Path

from vpltune.renderer.errors import InputError
from vpltune.tuner.batch.record import Record, Records
from vpltune.tuner.report.fit_folder import is_fit_folder, read_json_object

LISTING = "library.json"
"""File that maps the names of the scenes to the keys of their records."""


@dataclass(frozen=True)
class BatchFolder:
    """Contents of the output folder of a batch."""

    path: Path
    library: str
    """The folder or list that was tuned; empty if unknown."""
    records: dict[str, Record]
    """Records by the name of the scene in the library. Scenes with identical content share a record."""
    waiting: tuple[str, ...]
    """Names of the scenes without a record."""

    def output(self, record: Record) -> Path | None:
        """The folder of a record's fit; None if it has none or if the path leads out of the batch folder."""
        if not record.output:
            return None
        folder = (self.path / record.output).resolve()
        return folder if folder.is_relative_to(self.path.resolve()) and is_fit_folder(folder) else None


def is_batch_folder(path: Path) -> bool:
    """Whether `path` is the output folder of a batch, that is, has a subfolder `records`."""
    return (path / "records").is_dir()


def read_batch_folder(path: Path) -> BatchFolder:
    """Read library.json and the records that it names. Without library.json, read all records.

    Raises:
        InputError: library.json cannot be read or is malformed.
    """
    records = Records(path)
    if (path / LISTING).exists():
        document = read_json_object(path / LISTING)
        scenes = document.get("scenes")
        if not isinstance(scenes, dict) or not all(isinstance(key, str) for key in scenes.values()):
            raise InputError(
                f"{path / LISTING}: key 'scenes' must be an object of names to keys, got {scenes!r:.60}"
            )
        found = {name: records.read(Path(key).name) for name, key in scenes.items()}
        library = str(document.get("library", ""))
    else:
        every = [record for key in sorted(records.known_keys()) if (record := records.read(key)) is not None]
        found, library = {record.name: record for record in every}, ""
    known = {name: record for name, record in found.items() if record is not None}
    return BatchFolder(path, library, known, tuple(name for name in found if name not in known))
