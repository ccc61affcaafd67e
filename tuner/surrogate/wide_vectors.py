"""`jax.jit` for loops over pairs of receivers and VPLs, with the widest vectors of the processor.

LLVM prefers 256-bit vectors even where a processor has 512-bit ones, which is better for code that rarely
uses them. The gather, its gradient and the disc lights are faster with 512 bits. Lookups in visibility maps,
and sums with little arithmetic, are not.
"""

from collections.abc import Callable
from functools import cache, wraps
from typing import ParamSpec, TypeVar

import jax

P = ParamSpec("P")  # parameters of a function
R = TypeVar("R")  # its result

WIDEST = {"xla_cpu_prefer_vector_width": 512}
"""XLA's preferred vector width in bits. Processors with narrower vectors use theirs, and GPUs ignore it."""


def wide_jit(function: Callable[P, R]) -> Callable[P, R]:
    """`jax.jit` with the widest vectors.

    JAX accepts such options only for the outermost function. Inside a transformation or another compiled
    function, call the plain function, `__wrapped__`.
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
    """`WIDEST`, or None if this version of XLA does not know the option."""
    try:
        jax.jit(lambda: 0, compiler_options=WIDEST)()
    except jax.errors.JaxRuntimeError:
        return None
    return WIDEST
