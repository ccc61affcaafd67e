"""Cache the functions that JAX compiles in the user's cache folder, so that the next fit starts faster."""

import contextlib
import warnings
import zlib
from pathlib import Path

import jax

from vpltune.renderer.files.cache_folder import cache_folder

LEAST_SECONDS = 0.02
"""Functions that compile faster than this are not cached. A choice: they are not worth a file."""


def keep_compiled_functions() -> None:
    """Make JAX load compiled functions from, and store them in, the cache folder from now on."""
    drop_torn_entries(cache_folder() / "compiled")
    jax.config.update("jax_compilation_cache_dir", str(cache_folder() / "compiled"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", LEAST_SECONDS)
    # In a folder that cannot be read or written, JAX compiles without it, and warns of each function.
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache", UserWarning)


def drop_torn_entries(folder: Path) -> None:
    """Delete entries that a killed process left half-written. JAX ignores them but never replaces them.

    JAX writes entries in place, compressed with zlib if Python has no Zstandard. Only zlib entries are
    checked.
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
