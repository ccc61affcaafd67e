"""The runtime's speed: dynamic lights, gather, VPL placement, the whole indirect path, Python's share."""

from collections.abc import Callable

from benchmarks.row import Row
from benchmarks.runtime_gather import gather_rows
from benchmarks.runtime_lights import light_rows


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Every row of the light pre-pass, then of gather and placement."""
    return [*light_rows(progress), *gather_rows(progress)]
