"""Keeps what JAX compiles in the user's cache folder: a second fit need not compile it again."""

import contextlib
import zlib
from pathlib import Path

import jax

from vpltune.tuner.reference.cache import cache_folder

LEAST_SECONDS = 0.02
"""Of compilation, below which keeping a function is not worth a file."""


def keep_compiled_functions() -> None:
    """From here on, compiled functions are looked for, and kept, in the cache folder."""
    drop_torn_entries(cache_folder() / "compiled")
    jax.config.update("jax_compilation_cache_dir", str(cache_folder() / "compiled"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", LEAST_SECONDS)


def drop_torn_entries(folder: Path) -> None:
    """Remove entries that a killed process left half written: JAX compiles past them, but never mends them.

    JAX writes them in place, compressed with zlib where Python has no Zstandard.
    """
    for path in folder.glob("*-cache"):
        with contextlib.suppress(OSError):
            content = path.read_bytes()
            if not content or (content.startswith(b"\x78") and not _is_whole(content)):
                path.unlink()


def _is_whole(content: bytes) -> bool:
    unpacked = zlib.decompressobj()
    try:
        unpacked.decompress(content)
    except zlib.error:
        return False
    return unpacked.eof
