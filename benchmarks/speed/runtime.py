"""The speed of the runtime: dynamic lights, VPL placement, gather, indirect light, and every pass."""

from collections.abc import Callable

from benchmarks.harness.row import Row
from benchmarks.speed.runtime_gather import gather_rows
from benchmarks.speed.runtime_lights import light_rows
from benchmarks.speed.runtime_passes import pass_rows


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """The rows of the light pre-pass, of placement and gather, and of each pass of a frame."""
    return [*light_rows(progress), *gather_rows(progress), *pass_rows(progress)]
