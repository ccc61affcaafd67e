"""What a batch left on disk, as a report reads it: which scenes there are, and what became of each."""

from dataclasses import dataclass
from pathlib import Path

from vpltune.renderer.errors import InputError
from vpltune.tuner.batch.record import Record, Records
from vpltune.tuner.report.fit_folder import is_fit_folder, read_json_object

LISTING = "library.json"


@dataclass(frozen=True)
class BatchFolder:
    """A batch's folder, read."""

    path: Path
    library: str
    """The folder or list that was tuned."""
    records: dict[str, Record]
    """By name, as the library lists its scenes; two names may have one content, and one record."""
    waiting: tuple[str, ...]
    """Names without a record so far."""

    def output(self, record: Record) -> Path | None:
        """The folder of a record's fit; None where it has none, or names one outside the batch's."""
        if not record.output:
            return None
        folder = (self.path / record.output).resolve()
        return folder if folder.is_relative_to(self.path.resolve()) and is_fit_folder(folder) else None


def is_batch_folder(path: Path) -> bool:
    return (path / "records").is_dir()


def read_batch_folder(path: Path) -> BatchFolder:
    """Read library.json and the records that it names; all records where there is no listing.

    Raises:
        InputError: library.json cannot be read or is none.
    """
    records = Records(path)
    if (path / LISTING).exists():
        document = read_json_object(path / LISTING)
        scenes = document.get("scenes")
        if not isinstance(scenes, dict) or not all(isinstance(key, str) for key in scenes.values()):
            raise InputError(f"{path / LISTING}: key 'scenes' must be an object of keys by name")
        found = {name: records.read(Path(key).name) for name, key in scenes.items()}
        library = str(document.get("library", ""))
    else:
        every = [record for key in sorted(records.known_keys()) if (record := records.read(key)) is not None]
        found, library = {record.name: record for record in every}, ""
    known = {name: record for name, record in found.items() if record is not None}
    return BatchFolder(path, library, known, tuple(name for name in found if name not in known))
