"""Names the folder of a benchmark's results after the program that made them."""

import hashlib
from pathlib import Path

from benchmarks.harness.scene_library import REPOSITORY

SOURCES = ("renderer", "tuner", "shaders", "configs")
"""Folders whose files the digest covers."""
DIGEST_LENGTH = 16
"""Hexadecimal digits of the digest. A choice."""


def program_digest(benchmark: Path) -> str:
    """A digest of the code and data of fits and frames, and of a benchmark's own file."""
    digest = hashlib.sha256(benchmark.read_bytes())
    for source in SOURCES:
        for path in sorted((REPOSITORY / source).rglob("*")):
            if path.suffix in (".py", ".json", ".glsl", ".comp", ".frag", ".vert"):
                digest.update(str(path.relative_to(REPOSITORY)).encode() + path.read_bytes())
    return digest.hexdigest()[:DIGEST_LENGTH]
