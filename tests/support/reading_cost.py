"""What reading a file costs in processor time and memory, in a process of its own, its children included."""

import json
import subprocess
import sys
from pathlib import Path

CPU_S = 2.0
"""Processor time in s that reading a file may take whatever its size: docs/file_formats.md, "Scenes"."""
CPU_S_PER_BYTE = 3e-6
"""Further processor time in s for each byte of the file and those it refers to: same place."""
MEMORY_BYTES = 1 << 30
"""Memory that reading a file may take: same place."""

_READ = """
import json, resource, sys, time
from vpltune.renderer.errors import InputError
{setup}
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
start = time.process_time()
try:
    {read}
    message = ""
except InputError as refused:
    message = str(refused)
children = resource.getrusage(resource.RUSAGE_CHILDREN)
seconds = time.process_time() - start + children.ru_utime + children.ru_stime
grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
print(json.dumps([message, seconds, grown * 1024]))
"""
SCENE = ("from vpltune.renderer.scene.files import read_scene", "read_scene(sys.argv[1])")
"""How `read_scene` is loaded and called."""
MITSUBA = ("from vpltune.renderer.scene.mitsuba_import import read_mitsuba", "read_mitsuba(sys.argv[1])")
"""How a Mitsuba scene is read."""
BATCH = (
    "from pathlib import Path; from vpltune.tuner.batch.referred_files import referred_files",
    "referred_files(Path(sys.argv[1]))",
)
"""What a batch reads of a scene before it starts the fit with its limits."""

IMAGES = (
    "from pathlib import Path; from vpltune.tuner.evaluation.view_images import read_view_images",
    "read_view_images(Path(sys.argv[1]))",
)
"""How a report reads a fit's images."""


def check_cost(path: Path, how: tuple[str, str] = SCENE) -> str:
    """Read a file and hold the cost to the documented bound.

    Args:
        path: the file; files beside it with the same stem count too.
        how: what to load and what to call.

    Returns:
        The message if the file is refused, else nothing.
    """
    done = subprocess.run(
        [sys.executable, "-c", _READ.format(setup=how[0], read=how[1]), str(path)],
        capture_output=True,
        text=True,
        check=True,
    )
    message, seconds, grown = json.loads(done.stdout)
    size = sum(file.stat().st_size for file in path.parent.glob(f"{path.stem}.*"))
    assert seconds < CPU_S + CPU_S_PER_BYTE * size, f"{seconds:.1f} s for {size} bytes"
    assert grown < MEMORY_BYTES, f"{grown >> 20} MiB for {size} bytes"
    assert "\n" not in message
    return message
