"""How long `vpltune batch` takes with one worker and with two, and when every scene is already done."""

import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import OWN_SCENES

SCENES = 8
"""Scenes of the library. A choice: two workers get the same number."""
SECOND_RUN_LIMIT_S = 2.0
"""Seconds of a run that has nothing to do. A choice."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """The speed-up by a second worker, and the seconds of a run in which every scene has its record.

    For `efficiency_2_workers`, both runs render every reference, and each worker has one core.
    `second_run_s` times the whole command.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        varied_library(folder / "library", SCENES)
        varied_library(folder / "first", 1)
        # Work that a machine does once: finding Mitsuba's LLVM and compiling the fit.
        _batch_seconds(folder / "first", folder, "machine", 1)
        seconds = {}
        for index, workers in enumerate((1, 2)):
            progress("batch", 0.2 + 0.4 * index)
            seconds[workers] = _batch_seconds(folder / "library", folder, f"workers{workers}", workers)
        second = _batch_seconds(folder / "library", folder, "workers2", 2)
    progress("batch", 1.0)
    return [
        Row("efficiency_2_workers", seconds[1] / seconds[2], "x", "twice one worker", 2.0),
        Row("second_run_s", second, "s", "limit", SECOND_RUN_LIMIT_S),
    ]


def varied_library(folder: Path, count: int) -> None:
    """Write `count` scenes into `folder`: the shipped ones in turn, each copy with slightly brighter lights.

    A different light makes a different scene for every cache.
    """
    folder.mkdir()
    for index in range(count):
        source = OWN_SCENES[index % len(OWN_SCENES)]
        content = source.read_bytes()
        length = int.from_bytes(content[12:16], "little")
        document = json.loads(content[20 : 20 + length])
        for light in document["extensions"]["KHR_lights_punctual"]["lights"]:
            light["intensity"] *= 1.0 + 0.01 * index
        text = json.dumps(document).encode()
        text += b" " * (-len(text) % 4)
        rest = content[20 + length :]
        head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
        (folder / f"{source.stem}{index}.glb").write_bytes(head + text + rest)


def _batch_seconds(library: Path, folder: Path, name: str, workers: int) -> float:
    """Wall-clock seconds of the whole command.

    Runs with different `name` share no references; compiled functions are copied from the run "machine".
    """
    cache = folder / f"{name}.cache"
    if not cache.exists() and (folder / "machine.cache").exists():
        shutil.copytree(
            folder / "machine.cache", cache, ignore=shutil.ignore_patterns("references", "machine")
        )
    command = [
        sys.executable,
        "-m",
        "vpltune",
        "batch",
        str(library),
        "-o",
        str(folder / name),
        "--bounces",
        "1",
        "--json",
    ]
    started = time.perf_counter()
    finished = subprocess.run(
        [*command, "--workers", str(workers)],
        env={**os.environ, "VPLTUNE_CACHE": str(cache)},
        capture_output=True,
        check=True,
    )
    seconds = time.perf_counter() - started
    if json.loads(finished.stdout)["status"] != "ok":
        raise RuntimeError(f"the batch did not finish every scene: {finished.stdout.decode()}")
    return seconds
