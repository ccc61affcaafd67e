"""The runtime's speed: dynamic lights, gather, VPL placement, the whole indirect path, and every pass."""

from collections.abc import Callable

from benchmarks.harness.row import Row
from benchmarks.speed.runtime_gather import gather_rows
from benchmarks.speed.runtime_lights import light_rows
from benchmarks.speed.runtime_passes import pass_rows


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Every row of the light pre-pass, of gather and placement, then of one frame's passes."""
    return [*light_rows(progress), *gather_rows(progress), *pass_rows(progress)]
