"""A library tuned by one worker and by two, and a second run that finds everything done."""

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
SECOND_RUN_LIMIT_S = 2.0


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """`efficiency_2_workers`: how much sooner two workers are done than one, every reference rendered anew
    and each worker on one core. `second_run_s`: the whole command where every scene has its record."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        varied_library(folder / "library", SCENES)
        varied_library(folder / "first", 1)
        # What a machine does once: finding Mitsuba's LLVM, compiling the fit.
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
    """Our own scenes in turn, each time with its light a little brighter: another scene to every cache."""
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
    """Wall time of the whole command; references are kept apart by `name`, what is compiled is not."""
    cache = folder / f"{name}.cache"
    if not cache.exists() and (folder / "machine.cache").exists():
        shutil.copytree(
            folder / "machine.cache", cache, ignore=shutil.ignore_patterns("references", "machine")
        )
    command = [sys.executable, "-m", "vpltune", "batch", str(library), "-o", str(folder / name), "--json"]
    started = time.perf_counter()
    finished = subprocess.run(
        [*command, "--workers", str(workers)],
        env={**os.environ, "VPLTUNE_CACHE": str(cache)},
        capture_output=True,
        check=True,
    )
    seconds = time.perf_counter() - started
    if json.loads(finished.stdout)["status"] != "ok":
        raise RuntimeError(f"the batch did not end well: {finished.stdout.decode()}")
    return seconds
