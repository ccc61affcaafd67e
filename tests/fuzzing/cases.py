"""The readers that are fuzzed, and the names of cases, from which a case is made again."""

import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tests.fuzzing.document_cases import write_config_case, write_sidecar_case, write_views_case
from tests.fuzzing.environment_cases import write_environment_case
from tests.fuzzing.gltf_cases import write_gltf_case
from tests.fuzzing.mitsuba_cases import write_mitsuba_case
from tests.fuzzing.obj_cases import write_obj_case
from tests.fuzzing.ply_cases import write_ply_case
from vpltune.renderer.config.gltf_extras import write_gltf_extras
from vpltune.renderer.config.tuned_config import config_text, read_config
from vpltune.renderer.export.glb_writer import write_glb
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.mitsuba_import import read_mitsuba
from vpltune.renderer.scene.placement.given_sky import GivenSky
from vpltune.renderer.scene.placement.scene_sidecar import read_sidecar
from vpltune.renderer.scene.views import read_views

SHARE_UNCHANGED = 0.02
"""A choice: share of cases that are valid documents as they are, which a reader must not refuse."""


@dataclass(frozen=True)
class Reader:
    """A reader, and the writer of its cases."""

    write: Callable[[Path, random.Random, bool], Path]
    """Writes a case into a folder, changed or as it is; returns the path to read."""
    read: Callable[[Path], object]


def _import_mitsuba(path: Path) -> None:
    """As `vpltune import` does."""
    loaded = read_mitsuba(path)
    write_glb(path.with_name("imported.glb"), loaded, notes=loaded.warnings)


def _read_environment(path: Path) -> None:
    """As `--environment` does, turned so that all of the baking is passed through."""
    GivenSky(file=str(path), rotation_degrees=33.0).environment(None, str(path))


def _read_and_write_config(path: Path) -> None:
    """What was read can be written again."""
    config_text(read_config(path))


def _export_into_gltf(path: Path) -> None:
    """As `vpltune export --to gltf --scene` does."""
    write_gltf_extras(path, path.with_stem("exported"), {"format": "vpltune"})


READERS: dict[str, Reader] = {
    "gltf": Reader(write_gltf_case, read_scene),
    "obj": Reader(write_obj_case, read_scene),
    "ply": Reader(write_ply_case, read_scene),
    "mitsuba": Reader(write_mitsuba_case, _import_mitsuba),
    "sidecar": Reader(write_sidecar_case, read_sidecar),
    "environment": Reader(write_environment_case, _read_environment),
    "views": Reader(write_views_case, read_views),
    "config": Reader(write_config_case, _read_and_write_config),
    "extras": Reader(write_gltf_case, _export_into_gltf),
}
"""Reader by name."""


@dataclass(frozen=True)
class Case:
    """The name of a case. Equal names give equal files, as long as the writers stay as they are."""

    reader: str
    seed: int
    number: int

    def __str__(self) -> str:
        return f"{self.reader}:{self.seed}:{self.number}"

    @classmethod
    def parse(cls, text: str) -> "Case":
        """The case of a name such as gltf:1:4711.

        Raises:
            ValueError: the text is no such name.
        """
        reader, seed, number = text.split(":")
        if reader not in READERS:
            raise ValueError(f"{text}: the reader must be one of {', '.join(READERS)}")
        return cls(reader, int(seed), int(number))

    def write(self, folder: Path) -> tuple[Path, bool]:
        """Write the case's files into an empty folder: the path to read, and whether it was changed."""
        rng = random.Random(str(self))
        mutated = rng.random() >= SHARE_UNCHANGED
        return READERS[self.reader].write(folder, rng, mutated), mutated


def cases(readers: list[str], seed: int, first: int, count: int) -> list[Case]:
    """`count` cases from number `first` on, of one reader after the other."""
    return [Case(readers[i % len(readers)], seed, i // len(readers)) for i in range(first, first + count)]
