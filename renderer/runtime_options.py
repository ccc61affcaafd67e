"""What a program chooses of the runtime and an artist does not: how it computes, not what it shows."""

from dataclasses import dataclass
from typing import Literal, get_args

Interleave = Literal[1, 2, 4, 8]


@dataclass(frozen=True)
class RuntimeOptions:
    """How the runtime works.

    Raises:
        ValueError: a field has a value that it cannot have.
    """

    interleave: Interleave = 1
    """Pixels along the side of a block that shares the VPLs out among its pixels. 1 gathers every VPL at
    every pixel, which is what the tuner's surrogate is a twin of; 4 is some ten times faster."""

    def __post_init__(self) -> None:
        if self.interleave not in get_args(Interleave):
            raise ValueError(f"interleave: must be one of {get_args(Interleave)}, got {self.interleave!r}")
