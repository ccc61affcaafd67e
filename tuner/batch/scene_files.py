"""Find the scenes of a library: all scene files below a folder, or those named in a list."""

import os
from collections.abc import Iterator
from pathlib import Path

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files.scene_reader import SCENE_SUFFIXES
from vpltune.tuner.batch.referred_files import MITSUBA_SUFFIX, is_mitsuba_scene, referred_files

LONGEST_LIST_BYTES = 1 << 28
"""Largest list file that is read. A choice: room for millions of scenes."""


def library_scenes(library: Path, leave_out: Path) -> dict[str, Path]:
    """Map the name of every scene to its absolute path, sorted by path, or in the order of the list.

    A file that a Mitsuba scene refers to is part of that scene and not a scene itself. Files and folders
    whose name begins with a dot are skipped, and so is the folder `leave_out`.

    Raises:
        InputError: the library cannot be read, or has no scene.
    """
    library = library.absolute()
    if library.is_dir():
        scenes = {str(path.relative_to(library)): path for path in _below(library, leave_out.resolve())}
        rule = f"has no {', '.join((*SCENE_SUFFIXES, MITSUBA_SUFFIX))} file below it"
    else:
        scenes = {name: library.parent / name for name in _listed(library)}
        rule = "names no scene"
    if not scenes:
        raise InputError(f"{library}: {rule}")
    return scenes


def _below(library: Path, leave_out: Path) -> list[Path]:
    found: list[Path] = []
    for folder, folders, files in os.walk(library):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        folders[:] = [name for name in folders if Path(folder, name).resolve() != leave_out]
        found += (Path(folder, name) for name in sorted(files) if not name.startswith("."))
    mitsuba = [path for path in found if path.suffix.lower() == MITSUBA_SUFFIX and is_mitsuba_scene(path)]
    parts = {part for scene in mitsuba for part in referred_files(scene)}
    read = [path for path in found if path.suffix.lower() in SCENE_SUFFIXES]
    return sorted({*mitsuba, *read} - parts)


def _listed(library: Path) -> Iterator[str]:
    try:
        with library.open("rb") as file:
            content = file.read(LONGEST_LIST_BYTES + 1)
        text = content.decode("utf-8-sig")
    except OSError as error:
        raise InputError(f"{library}: cannot be read ({error.strerror})") from error
    except UnicodeDecodeError as error:
        raise InputError(
            f"{library}: must be a folder, or a text file with one scene per line; this is not UTF-8 text "
            f"(byte {error.start})"
        ) from error
    if len(content) > LONGEST_LIST_BYTES:
        raise InputError(
            f"{library}: a list of scenes must be at most {LONGEST_LIST_BYTES} bytes long, this one is longer"
        )
    for line in text.splitlines():
        name = line.strip()
        if name and not name.startswith("#"):
            yield name
