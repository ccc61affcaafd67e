"""Loops over pairs of receivers and VPLs, compiled for the widest vectors that the processor has.

LLVM stays at 256 bits where a processor has 512, for the sake of code that seldom needs them. The gather, its
gradient and discs are faster with all of them; what picks texels of maps, or sums with hardly any arithmetic,
is not.
"""

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

import jax

P = ParamSpec("P")
R = TypeVar("R")

WIDEST = {"xla_cpu_prefer_vector_width": 512}
"""Bits. Processors that have fewer go by what they have, and GPUs by their own."""


def wide_jit(function: Callable[P, R]) -> Callable[P, R]:
    """`jax.jit` with the widest vectors.

    JAX takes such options of the outermost function only: what calls this under a transformation or in a
    function to be compiled must call the plain one (`__wrapped__`).
    """

    @wraps(function)
    def compiled(*arguments: P.args, **named: P.kwargs) -> R:
        return _compiled(function)(*arguments, **named)

    return compiled


@cache
def _compiled(function: Callable) -> Callable:
    return jax.jit(function, compiler_options=_options())


@cache
def _options() -> dict[str, int] | None:
    """None where this version of XLA has another name for it."""
    try:
        jax.jit(lambda: 0, compiler_options=WIDEST)()
    except jax.errors.JaxRuntimeError:
        return None
    return WIDEST
