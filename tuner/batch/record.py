"""What became of a scene: one file each, the truth about a library. Whoever schedules keeps nothing."""

import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, Literal

from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.strict_json import strict_json

Status = Literal["done", "unlit", "failed", "refused"]

SUFFIX = ".json"


@dataclass(frozen=True)
class Record:
    """The end of one scene's work. While a scene has none, it is still to be done."""

    key: str
    """Hash of everything that the fit depends on, see `tuner.batch.job_key`."""
    scene: str
    """The scene file, an absolute path."""
    name: str
    """The scene file as the library names it: relative to its folder."""
    status: Status
    """`done`: fitted, whether or not that was better than the start, see `fit`. `unlit`: no indirect light
    reaches its views, so the start is kept. `refused`: the file cannot be used, whatever is tried.
    `failed`: every attempt failed."""
    reason: str
    """How the fit ended, or why there is none; one line."""
    seconds: float
    """Wall time of the attempt that ended it."""
    attempts: int
    output: str
    """Folder of tuned.json, images and metrics, relative to the batch's own; empty where none was made."""
    host: str
    finished: str
    """When: ISO 8601, in UTC."""
    peak_memory_bytes: int = 0
    """Most memory that the process had up to then; 0 where it is not known."""
    stages: dict[str, float] = field(default_factory=dict)
    """Seconds of each stage of the fit."""
    fit: str = ""
    """How a fit that was made ended: `tuner.fitting.fit_status.Outcome`; empty where there is none."""


class Records:
    """The records of one batch folder, in its folder `records`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "records"

    def known_keys(self) -> set[str]:
        """Keys of all records, by one look at the folder: no file is opened."""
        return {name.removesuffix(SUFFIX) for name in self._names() if not name.startswith(".")}

    def unfinished_files(self) -> Iterator[tuple[str, Path]]:
        """Key and path of every temporary file that a killed process left."""
        for name in self._names():
            if name.startswith("."):
                yield name[1:].partition("-")[0], self._folder / name

    def read(self, key: str) -> Record | None:
        """The record of `key`; None where there is none, or what is there is no record."""
        try:
            document = json.loads(self.path(key).read_text(encoding="utf-8"))
            return Record(**{name: document[name] for name in _NAMES})
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def write(self, record: Record) -> None:
        """Keep `record`, whole or not at all."""
        write_text_whole(self.path(record.key), strict_json(asdict(record)) + "\n")

    def remove(self, key: str) -> None:
        """Forget what became of `key`, so that it is done again."""
        self.path(key).unlink(missing_ok=True)

    def path(self, key: str) -> Path:
        """Where the record of `key` lies, whether or not it exists."""
        return self._folder / f"{key}{SUFFIX}"

    def _names(self) -> list[str]:
        try:
            with os.scandir(self._folder) as entries:
                return [entry.name for entry in entries if entry.name.endswith(SUFFIX)]
        except FileNotFoundError:
            return []


_NAMES = tuple(item.name for item in fields(Record))


def as_document(record: Record) -> dict[str, Any]:
    """The record as its file and `vpltune batch --json` have it."""
    return asdict(record)
