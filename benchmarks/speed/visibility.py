"""What visibility maps cost: casting them and gathering with them, against gathering without them.

The passes are timed one by one, as `vpltune render --interleave 4` draws them at `SIZE`. Frames with and
without maps are drawn in turns, so that other load on the machine slows both alike.
"""

from collections.abc import Callable

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import own_scene, scene_and_view
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig, Visibility
from vpltune.renderer.frame.frame_timing import truthful_clock
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.gpu_context import create_context

SIZE = (1920, 1080)
"""Width and height of the image in pixels: 1080p."""
COUNTS = (64, 256, 1024)
"""VPL counts. A choice: up to the default."""
INTERLEAVE = 4
"""Pixels along the side of an interleaved block. A choice."""
ROUNDS = 3
"""Frames of each kind, of which the fastest counts, pass by pass. A choice."""
WITHOUT, WITH = "transmittance", "maps"
MODES: tuple[Visibility, Visibility] = (WITHOUT, WITH)
"""Visibility without and with maps. Transmittance costs next to nothing in the gather."""
MAPS = "vpl_visibility_maps"
GATHER = ("vpl_gather", "interleaved_filter")


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """For each count N, the cost of visibility maps as a whole and by pass.

    `maps_<N>` compares maps and gather with the gather alone. `maps_<N>_<pass>` compares a pass with the same
    pass without maps, and the pass that casts the maps with the gather alone.
    """
    scene, view = scene_and_view(own_scene("gallery"), SIZE)
    found = []
    with create_context() as context:
        runtime = Runtime(scene, context=context)
        clock = truthful_clock(runtime.opengl_renderer)
        state = f"{SIZE[0]}x{SIZE[1]}, {INTERLEAVE}x{INTERLEAVE} interleaved, {clock} clock"
        for index, count in enumerate(COUNTS):
            progress("visibility", index / len(COUNTS))
            timed: dict[str, list[dict[str, float]]] = {mode: [] for mode in MODES}
            for _ in range(ROUNDS):
                for mode in MODES:
                    timed[mode].append(runtime.pass_milliseconds(view, _config(count, mode), 1))
            found += _rows_of(count, _fastest(timed[WITHOUT]), _fastest(timed[WITH]), state)
    progress("visibility", 1.0)
    return found


def _config(count: int, mode: Visibility) -> TunedConfig:
    quality = Quality(interleave=INTERLEAVE)
    return TunedConfig(ArtistParameters(vpl_count=count), visibility=mode, quality=quality)


def _fastest(rounds: list[dict[str, float]]) -> dict[str, float]:
    """The least milliseconds of each pass that maps change; 0 for a pass that did not run."""
    return {name: min(each.get(name, 0.0) for each in rounds) for name in (*GATHER, MAPS)}


def _rows_of(count: int, without: dict[str, float], with_maps: dict[str, float], state: str) -> list[Row]:
    alone = sum(without.values())
    against = f"gather without maps ({state})"
    return [
        Row(f"maps_{count}", sum(with_maps.values()), "ms", against, alone),
        Row(f"maps_{count}_{MAPS}", with_maps[MAPS], "ms", against, alone),
        *(
            Row(f"maps_{count}_{name}", with_maps[name], "ms", "the same pass without maps", without[name])
            for name in GATHER
        ),
    ]
