"""The key of a scene's record: a hash of everything that its fit depends on.

The hash of each file is cached in `inputs.json` in the batch folder. It is valid as long as the size and the
timestamps of the file stay the same. Without `inputs.json`, all files are hashed again.
"""

import contextlib
import hashlib
import importlib.metadata
import json
import os
import stat
import time
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Any

from vpltune.renderer.config.tuned_config import parse_config
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.scene.placement.sidecar_file import sidecar_path
from vpltune.tuner.batch.job import JobOptions
from vpltune.tuner.batch.referred_files import referred_files

KEY_VERSION = 3
"""Increase it whenever a code change alters the record of the same inputs. Old records are then ignored."""
SETTLED_SECONDS = 2.0
"""A digest is not cached if the file changed less than this before it was hashed: within the same tick of the
clock it could change again without a new timestamp. A choice."""

Stamp = list[int] | None
"""Size in bytes, mtime and ctime in ns; None for a missing file."""


class SceneInputs:
    """Digests of scenes and the files that they refer to, cached in the batch folder."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "inputs.json"
        self._known: dict[str, list[list[Any]]] = {}
        self._new = False
        with contextlib.suppress(OSError, ValueError):
            known = json.loads(self._path.read_text(encoding="utf-8"))
            self._known = known if isinstance(known, dict) else {}

    def digest(self, scene: Path) -> tuple[str, int]:
        """Hex SHA-256 of the scene file, its sidecar and the files it refers to; and their size in bytes."""
        entries = self._known.get(str(scene))
        if entries is None or any(_stamp(Path(path)) != stamp for path, stamp, _ in entries):
            entries = self._hashed(scene)
        parts = [digest for _, _, digest in entries]
        text = json.dumps([scene.suffix.lower(), *parts])
        return hashlib.sha256(text.encode()).hexdigest(), sum(stamp[0] for _, stamp, _ in entries if stamp)

    def save(self) -> None:
        """Write the new digests to `inputs.json`.

        Raises:
            InputError: the file cannot be written.
        """
        if self._new:
            write_text_whole(self._path, json.dumps(self._known) + "\n")
            self._new = False

    def _hashed(self, scene: Path) -> list[list[Any]]:
        began = time.time_ns()
        entries = []
        for path in (scene, sidecar_path(scene), *referred_files(scene)):
            stamp = _stamp(path)
            entries.append([str(path), stamp, None if stamp is None else _file_digest(path)])
        latest = max((max(stamp[1:]) for _, stamp, _ in entries if stamp), default=0)
        if began - latest > SETTLED_SECONDS * 1e9:
            self._known[str(scene)] = entries
            self._new = True
        return entries


def job_key(content_digest: str, options: JobOptions) -> str:
    """Hex SHA-256 of a scene's content, the options of its fit, and the versions of vpltune, JAX and Mitsuba.

    Raises:
        InputError: `options.start` is not a valid config.
    """
    return hashlib.sha256(f"{content_digest} {_settings(options)}".encode()).hexdigest()


@lru_cache
def _settings(options: JobOptions) -> str:
    start = parse_config(options.start, "the start of the fit")
    settings = asdict(options) | {"start": start.parameters.as_dict(), "visibility": start.visibility}
    settings["quality"] = start.quality.as_dict()
    settings["light"] = start.light.as_dict()
    if options.environment is not None:
        # What is in the file counts, not where it lies.
        settings["environment"] = {"sha256": _file_digest(Path(options.environment))}
    if start.auto is not None:
        settings["auto"] = start.auto.as_dict()
    versions = {name: importlib.metadata.version(name) for name in ("vpltune", "jax", "mitsuba")}
    return json.dumps({"key": KEY_VERSION, "options": settings, "versions": versions}, sort_keys=True)


def _stamp(path: Path) -> Stamp:
    try:
        found = path.stat()
    except OSError:
        return None
    # Devices and pipes are not scenes and must never be opened.
    regular = stat.S_ISREG(found.st_mode)
    return [found.st_size, found.st_mtime_ns, found.st_ctime_ns] if regular else None


def _file_digest(path: Path) -> str | None:
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None
