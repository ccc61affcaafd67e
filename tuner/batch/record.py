"""The result of each scene, one file each. The state of a batch is in these files; schedulers keep none."""

import json
import os
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Literal

from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.small_text import read_small_text
from vpltune.renderer.files.strict_json import strict_json

Status = Literal["done", "unlit", "failed", "refused"]

SUFFIX = ".json"
"""File name extension of a record."""
# A choice: most bytes of a record, which usually has 1 kB.
_LARGEST_FILE = 1 << 20


@dataclass(frozen=True)
class Record:
    """The result of one scene. A scene without a record still has to be tuned."""

    key: str
    """Hash of everything that the fit depends on, see `tuner.batch.job_key`."""
    scene: str
    """Absolute path of the scene file."""
    name: str
    """Name of the scene in the library, relative to the library's folder."""
    status: Status
    """`done`: fitted, whether or not the result beats the start; see `fit`. `unlit`: no indirect light
    reaches the views, so the start is kept. `refused`: the scene file cannot be used, and a retry would not
    help. `failed`: every attempt failed."""
    reason: str
    """Outcome of the fit, or why there is none; one line."""
    seconds: float
    """Wall time of the last attempt."""
    attempts: int
    output: str
    """Folder of tuned.json, images and metrics, relative to the batch folder; empty if there is none."""
    host: str
    finished: str
    """End of the last attempt, ISO 8601 in UTC."""
    peak_memory_bytes: int = 0
    """Peak memory of the process until then; 0 if unknown."""
    stages: dict[str, float] = field(default_factory=dict)
    """Seconds that each stage of the fit took."""
    fit: str = ""
    """Outcome of the fit, `tuner.fitting.fit_status.Outcome`; empty if there was no fit."""


class Records:
    """The records of one batch, in the subfolder `records` of its folder."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "records"

    def known_keys(self) -> set[str]:
        """Keys of all records, from the file names alone."""
        return {name.removesuffix(SUFFIX) for name in self._names() if not name.startswith(".")}

    def read(self, key: str) -> Record | None:
        """The record of `key`, or None if it is missing or damaged."""
        try:
            document = json.loads(read_small_text(self.path(key), _LARGEST_FILE))
            return Record(**{name: document[name] for name in _NAMES})
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def write(self, record: Record) -> None:
        """Write `record` atomically.

        Raises:
            InputError: the file cannot be written.
        """
        write_text_whole(self.path(record.key), strict_json(asdict(record)) + "\n")

    def remove(self, key: str) -> None:
        """Delete the record of `key`, if there is one, so that its scene is tuned again."""
        self.path(key).unlink(missing_ok=True)

    def path(self, key: str) -> Path:
        """Path of the record of `key`, whether or not it exists."""
        return self._folder / f"{key}{SUFFIX}"

    def _names(self) -> list[str]:
        try:
            with os.scandir(self._folder) as entries:
                return [entry.name for entry in entries if entry.name.endswith(SUFFIX)]
        except FileNotFoundError:
            return []


_NAMES = tuple(item.name for item in fields(Record))


def as_document(record: Record) -> dict[str, Any]:
    """The record as JSON values, as in its file and in `vpltune batch --json`."""
    return asdict(record)
