"""One scene to tune, in a form that can be sent to another process."""

import dataclasses
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from vpltune.renderer.files.atomic_file import write_text_whole

if TYPE_CHECKING:
    from vpltune.tuner.scene_fit.fit_scene import FitOptions

LONGEST_STEM = 60
"""Characters of the scene's file name in the name of its output folder. A choice."""


def short_key(key: str) -> str:
    """The first 12 hex digits of a key. With eight, about one pair among 100,000 scenes would clash."""
    return key[:12]


def claim_path(folder: Path, key: str) -> Path:
    """Path of the claim on the scene of `key`, see `tuner.batch.claim`."""
    return folder / "claims" / short_key(key)


@dataclass(frozen=True)
class JobOptions:
    """Options of every fit in a batch, with the meaning that they have in `vpltune fit`."""

    start: str
    """Start of the fit: the text of a config file."""
    views: int = 4
    seed: int = 0
    size: tuple[int, int] | None = None
    """Width and height of the views in pixels; None for the default of a fit."""
    sky: tuple[float, float, float] | None = None
    """Radiance of an even sky in W/(m² sr) for all scenes; None for each scene's own."""
    environment: str | None = None
    """Absolute path of an environment map for all scenes; None for each scene's own."""

    def fit_options(self, command: str | None) -> "FitOptions":
        """The options as `fit_scene` takes them. `command` is the command line, for the record.

        Raises:
            InputError: `start` is not a valid config.
        """
        from vpltune.renderer.config.tuned_config import parse_config
        from vpltune.renderer.scene.placement.given_sky import GivenSky
        from vpltune.tuner.scene_fit.fit_scene import FitOptions

        start = parse_config(self.start, "the start of the fit")
        given = self.sky is not None or self.environment is not None
        options = FitOptions(
            start=start,
            views=self.views,
            seed=self.seed,
            command=command,
            sky=GivenSky(self.sky, self.environment) if given else None,
        )
        return options if self.size is None else replace(options, size=self.size)


@dataclass(frozen=True)
class Job:
    """A scene, the folder of its batch, and the options of its fit."""

    key: str
    """Hash of everything that the fit depends on, see `tuner.batch.job_key`."""
    scene: str
    """Absolute path of the scene file."""
    name: str
    """Name of the scene in the library."""
    folder: str
    """Absolute path of the batch folder."""
    options: JobOptions
    input_bytes: int = 0
    """Size of the scene and all files that it refers to. The time of the fit is estimated from it."""
    command: str | None = None
    """The command line, for the record."""

    @property
    def output_name(self) -> str:
        """The scene's output folder, relative to the batch folder."""
        stem = re.sub(r"[^A-Za-z0-9._-]+", "_", Path(self.scene).stem).lstrip(".")[:LONGEST_STEM]
        return f"scenes/{stem or 'scene'}-{short_key(self.key)}"

    @property
    def output(self) -> Path:
        """The scene's output folder."""
        return Path(self.folder) / self.output_name

    @property
    def claim(self) -> Path:
        """Path of the claim on this scene."""
        return claim_path(Path(self.folder), self.key)

    def to_json(self) -> str:
        """The job as one JSON object."""
        return json.dumps(dataclasses.asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "Job":
        """The job that `to_json` wrote."""
        document = json.loads(text)
        options = document.pop("options")
        # JSON has no tuples.
        for name in ("size", "sky"):
            options[name] = None if options[name] is None else tuple(options[name])
        return cls(**document, options=JobOptions(**options))


def write_jobs(path: Path, jobs: Sequence[Job]) -> None:
    """Write the jobs of one batch, at least one, to a file. Fields that they share are written once."""
    common = json.loads(jobs[0].to_json())
    document = {name: common[name] for name in ("folder", "options", "command")}
    document["jobs"] = [[job.key, job.scene, job.name, job.input_bytes] for job in jobs]
    write_text_whole(path, json.dumps(document) + "\n")


def read_jobs(path: Path) -> list[Job]:
    """Read the jobs from a file that `write_jobs` wrote."""
    document = json.loads(path.read_text(encoding="utf-8"))
    names = ("key", "scene", "name", "input_bytes")
    common = {name: document[name] for name in ("folder", "options", "command")}
    return [
        Job.from_json(json.dumps({**common, **dict(zip(names, values, strict=True))}))
        for values in document["jobs"]
    ]
