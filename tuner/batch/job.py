"""One scene to be tuned, as it travels to whatever process does it."""

import dataclasses
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from vpltune.renderer.files.atomic_file import write_text_whole

if TYPE_CHECKING:
    from vpltune.tuner.scene_fit.fit_scene import FitOptions

LONGEST_STEM = 60


def short_key(key: str) -> str:
    """Enough of a key to tell scenes apart: among 100,000 of one name, eight digits would clash once."""
    return key[:12]


def claim_path(folder: Path, key: str) -> Path:
    """The file that whoever works on the scene of `key` holds."""
    return folder / "claims" / short_key(key)


@dataclass(frozen=True)
class JobOptions:
    """What every scene of a batch is fitted with: `vpltune fit`'s own options."""

    start: str
    """Where the fit starts: the text of a config file."""
    views: int = 4
    seed: int = 0
    bounces: str = "1"
    size: tuple[int, int] | None = None
    """Width and height of the views in pixels; None leaves it to the fit."""

    def fit_options(self, command: str | None) -> "FitOptions":
        """The same, as `fit_scene` takes them; `command` is what was typed."""
        from vpltune.renderer.config.tuned_config import parse_config
        from vpltune.tuner.scene_fit.fit_scene import FitOptions

        size = {} if self.size is None else {"size": self.size}
        start = parse_config(self.start, "the start of the fit")
        return FitOptions(
            start=start, views=self.views, seed=self.seed, bounces=self.bounces, command=command, **size
        )


@dataclass(frozen=True)
class Job:
    """A scene, the folder of its batch, and how it is fitted."""

    key: str
    scene: str
    """Absolute path."""
    name: str
    """As the library names it."""
    folder: str
    """The batch's folder, an absolute path."""
    options: JobOptions
    input_bytes: int = 0
    """Of the scene and all it refers to: the first guess of how long it takes."""
    command: str | None = None
    """What was typed, for the record."""

    @property
    def output_name(self) -> str:
        """The scene's output folder, relative to the batch's."""
        stem = re.sub(r"[^A-Za-z0-9._-]+", "_", Path(self.scene).stem).lstrip(".")[:LONGEST_STEM]
        return f"scenes/{stem or 'scene'}-{short_key(self.key)}"

    @property
    def output(self) -> Path:
        """The scene's output folder."""
        return Path(self.folder) / self.output_name

    @property
    def claim(self) -> Path:
        """The file that whoever works on this scene holds."""
        return claim_path(Path(self.folder), self.key)

    def to_json(self) -> str:
        return json.dumps(dataclasses.asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "Job":
        document = json.loads(text)
        options = document.pop("options")
        size = options.pop("size")
        return cls(**document, options=JobOptions(**options, size=None if size is None else tuple(size)))


def write_jobs(path: Path, jobs: Sequence[Job]) -> None:
    """Write jobs of one batch to a file, what they have in common once."""
    common = json.loads(jobs[0].to_json())
    document = {name: common[name] for name in ("folder", "options", "command")}
    document["jobs"] = [[job.key, job.scene, job.name, job.input_bytes] for job in jobs]
    write_text_whole(path, json.dumps(document) + "\n")


def read_jobs(path: Path) -> list[Job]:
    """The jobs of a file that `write_jobs` wrote."""
    document = json.loads(path.read_text(encoding="utf-8"))
    names = ("key", "scene", "name", "input_bytes")
    common = {name: document[name] for name in ("folder", "options", "command")}
    return [
        Job.from_json(json.dumps({**common, **dict(zip(names, values, strict=True))}))
        for values in document["jobs"]
    ]
