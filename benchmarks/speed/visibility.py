"""What visibility maps cost: maps and gather against the gather without, pass by pass.

The image is `SIZE` with 4×4 interleaving, as `vpltune render --interleave 4` draws it. Passes are timed one
by one, by GPU timers where they tell the truth and by the finished wall clock where they do not; frames with
and without maps are drawn in turn, so that a busy machine is busy for both.
"""

from collections.abc import Callable
from pathlib import Path

import moderngl

from benchmarks.harness.row import Row
from vpltune import configs
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig, Visibility
from vpltune.renderer.frame.frame_timing import truthful_clock
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View

SIZE = (1920, 1080)
COUNTS = (64, 256, 1024)
INTERLEAVE = 4
ROUNDS = 3
MAPS = "vpl_visibility_maps"
GATHER = ("vpl_gather", "interleaved_filter")


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """For each count `maps_<N>`, maps and gather against the gather alone; then `maps_<N>_<pass>`, each pass
    with maps against the same without (the maps themselves against the gather alone)."""
    path = Path(configs.__file__).parent / "scenes" / "gallery.glb"
    scene = read_scene(path)
    camera, lights, _ = resolve_camera_and_lights(scene, path, None, None)
    view = View("visibility", "fitted", SIZE, camera, lights)
    found = []
    with create_context() as context:
        clock = truthful_clock(str(context.info["GL_RENDERER"]))
        state = f"{SIZE[0]}x{SIZE[1]}, {INTERLEAVE}x{INTERLEAVE} interleaved, {clock} clock"
        for index, count in enumerate(COUNTS):
            progress("visibility", index / len(COUNTS))
            runtimes = {mode: _runtime(context, scene, count, mode) for mode in ("none", "maps")}
            timed: dict[str, list[dict[str, float]]] = {mode: [] for mode in runtimes}
            for _ in range(ROUNDS):
                for mode, runtime in runtimes.items():
                    timed[mode].append(runtime.pass_milliseconds(view, 1))
            found += _rows_of(count, *(_best(timed[mode]) for mode in ("none", "maps")), state)
    progress("visibility", 1.0)
    return found


def _runtime(context: moderngl.Context, scene: Scene, count: int, mode: Visibility) -> Runtime:
    config = TunedConfig(ArtistParameters(vpl_count=count), visibility=mode)
    return Runtime(scene, config, RuntimeOptions(interleave=INTERLEAVE), context=context)


def _best(rounds: list[dict[str, float]]) -> dict[str, float]:
    return {name: min(each.get(name, 0.0) for each in rounds) for name in (*GATHER, MAPS)}


def _rows_of(count: int, without: dict[str, float], with_maps: dict[str, float], state: str) -> list[Row]:
    alone = sum(without.values())
    against = f"gather without visibility ({state})"
    return [
        Row(f"maps_{count}", sum(with_maps.values()), "ms", against, alone),
        Row(f"maps_{count}_{MAPS}", with_maps[MAPS], "ms", against, alone),
        *(
            Row(f"maps_{count}_{name}", with_maps[name], "ms", "the same pass without", without[name])
            for name in GATHER
        ),
    ]
