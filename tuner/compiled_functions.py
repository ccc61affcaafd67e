"""Keeps what JAX compiles in the user's cache folder: a second fit need not compile it again."""

import jax

from tuner.reference.cache import cache_folder

LEAST_SECONDS = 0.1
"""Of compilation, below which keeping a function is not worth a file."""


def keep_compiled_functions() -> None:
    """From here on, compiled functions are looked for, and kept, in the cache folder."""
    jax.config.update("jax_compilation_cache_dir", str(cache_folder() / "compiled"))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", LEAST_SECONDS)
