"""Cuts work over all pairs of receivers and VPLs into chunks whose arrays stay in a core's cache."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array


def receivers_at_once(vpl_count: int, pairs: int) -> int:
    """Receivers in a chunk of at most `pairs` pairs with all VPLs: a power of two, at least 1."""
    return 2 ** max((pairs // max(vpl_count, 1)).bit_length() - 1, 0)


def map_receivers(
    of_chunk: Callable[..., Array],
    arrays: tuple[Any, ...],
    vpl_count: int,
    pairs_at_once: int,
) -> Array:
    """`of_chunk(*arrays)` over all receivers, a chunk of them at a time.

    Args:
        of_chunk: takes a chunk of each of `arrays`, returns [chunk, ...].
        arrays: each [receivers, ...], or None, which is handed on as it is. The first is not None.
        vpl_count: VPLs that each receiver is paired with.
        pairs_at_once: most pairs in a chunk.

    Returns:
        [receivers, ...].
    """
    count = arrays[0].shape[0]
    size = min(receivers_at_once(vpl_count, pairs_at_once), max(count, 1))

    def chunked(values: Any) -> Any:
        padded = jnp.pad(values, ((0, -count % size), *[(0, 0)] * (values.ndim - 1)))
        return padded.reshape(-1, size, *values.shape[1:])

    chunks = jax.tree.map(chunked, arrays)
    results = jax.lax.map(lambda chunk: of_chunk(*chunk), chunks)
    return results.reshape(-1, *results.shape[2:])[:count]
