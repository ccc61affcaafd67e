"""The real-time table of the machine at hand: passes, frames, dynamic lights, and what they replace.

    vpltune bench gpu

| rows | what |
|---|---|
| `pass.*` | each pass of the default frame at 1080p, with visibility maps and without |
| `frame.*` | frames from 720p to 4K, with 64 to 4,096 points or clustered discs, in full and interleaved |
| `lights.*` | 1,000 to 100,000 dynamic lights, in tiles and as volumes |
| `vpls.*` | the gather against a draw for each VPL, placement against a read-back of the RSM |
| `python.*` | Python's part of a frame |

Rows are compared with the least time that their arithmetic and memory traffic take at this machine's own
rates (`benchmarks.speed.frame_limits`), where not another way to do the same is named. Timer queries are used
where they tell the truth, else the wall clock around a finished frame. A row that is expected to take longer
than `Timing.row_seconds` is left out, and says so; Ctrl-C prints the rows that there are.
"""

import math
from collections.abc import Callable, Iterator

from benchmarks.harness.machine_rates import measured_rates
from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import own_scene, scene_and_view
from benchmarks.speed.gpu_alternatives import alternative_rows
from benchmarks.speed.gpu_frames import SIZES, MeasuredScene, Timing, frame_count, frame_rows, pass_rows
from benchmarks.speed.gpu_lights import LIGHT_ROWS, light_rows
from vpltune.renderer.gpu.gpu_context import create_context

TIMING = Timing()
"""How long a row may take."""


def rows(progress: Callable[[str, float], None]) -> Iterator[Row]:
    """All rows, each as soon as it is measured."""
    scene, view = scene_and_view(own_scene("gallery"), SIZES["1080p"])
    with create_context() as context:
        progress("rates", 0.0)
        rates = measured_rates(context)
        measured = MeasuredScene(scene, view, context, rates, TIMING)
        parts: dict[str, tuple[Iterator[Row], float]] = {
            "passes": (pass_rows(measured), math.inf),
            "frames": (frame_rows(measured), frame_count()),
            "lights": (light_rows(measured), LIGHT_ROWS),
            "alternatives": (alternative_rows(measured), 3),
        }
        for name, (found, count) in parts.items():
            progress(name, 0.0)
            for index, row in enumerate(found):
                yield row
                progress(name, (index + 1) / count)
            progress(name, 1.0)
