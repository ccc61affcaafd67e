"""VPL placement, gather and the whole indirect path: interleaved against full, GPU against read-back."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import moderngl
import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import present_scenes
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig, Visibility
from vpltune.renderer.frame.capture import read_image
from vpltune.renderer.frame.frame import Frame, frame_light_records
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.light_faces import LightRecords
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.views import View
from vpltune.renderer.techniques.vpls_readback import VplsReadback

SIZE = (640, 360)
SIZE_1080P = (1920, 1080)
VPL_COUNT = 1024
READBACK_DRAWS = 128
"""VPLs drawn one by one; their time is stated for `VPL_COUNT`."""
_PARAMETERS = ArtistParameters(vpl_count=VPL_COUNT, screen_space_strength=1.0)
HARD_SCENES = ("sketchfab-macross-diorama", "playcanvas-chess-board", "bevy-mixedlightingexample")
"""Where interleaving has it hardest: small parts and round bodies, whose windows lack subsets."""
TARGET_MS = 1.0
"""The whole indirect path at 1080p with 1,024 VPLs on a data-centre GPU."""


def gather_rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Rows of placement and gather; milliseconds of the best of a few runs."""
    with create_context() as context:
        return _rows(context, progress)


def _rows(context: moderngl.Context, progress: Callable[[str, float], None]) -> list[Row]:
    paths = present_scenes()
    scene = _BenchmarkScene(context, paths["gallery"])
    progress("full gather", 0.0)
    drawn = scene.drawn(SIZE, RuntimeOptions(), "none")
    full = _full_gather(context, drawn, repeats=2)
    progress("one draw for each VPL", 0.25)
    read, placed, one_by_one = _readback_milliseconds(context, drawn)
    progress("VPL placement", 0.35)
    placement = _milliseconds(context, lambda: _place(drawn), repeats=5)
    progress("interleaved gather", 0.4)
    rows = [
        _interleaved_row(context, "gather_interleaved_4x4", scene, "none", full),
        Row(
            "gather_full",
            full.milliseconds,
            "ms",
            f"one additive draw per VPL, from {READBACK_DRAWS}, without maps",
            one_by_one,
        ),
        Row(
            "vpls_gpu",
            placement,
            "ms",
            f"vpls_readback: RSM read back {read:.3g} ms, Poisson-disc VPLs made on the CPU",
            read + placed,
        ),
    ]
    progress("indirect path at 1080p", 0.45)
    drawn = scene.drawn(SIZE_1080P, RuntimeOptions(interleave=4), "none")
    whole = _indirect_milliseconds(context, drawn)
    rows.append(
        Row("frame_1080p_1024vpl", whole, "ms", "target on a data-centre GPU, without maps", TARGET_MS)
    )
    others = [("gallery", "maps"), *((name, mode) for name in HARD_SCENES for mode in ("none", "maps"))]
    others = [(name, mode) for name, mode in others if name in paths]
    for index, (name, mode) in enumerate(others):
        progress(f"interleaved gather, {name}", 0.6 + 0.4 * index / len(others))
        scene = _BenchmarkScene(context, paths[name])
        full = _full_gather(context, scene.drawn(SIZE, RuntimeOptions(), mode), repeats=1)
        suffix = "_maps" if mode == "maps" else ""
        rows.append(_interleaved_row(context, f"gather_interleaved_4x4_{name}{suffix}", scene, mode, full))
    return rows


class _BenchmarkScene:
    """A scene on the GPU, by its own camera and lights, or those placed for it."""

    def __init__(self, context: moderngl.Context, path: Path):
        self._scene = read_scene(path)
        self._context = context
        self._camera, self._lights, _ = resolve_camera_and_lights(self._scene, path, None, None)

    def drawn(self, size: tuple[int, int], options: RuntimeOptions, visibility: Visibility) -> "_Drawn":
        """A frame that has been drawn once, so that shaders are compiled and buffers filled."""
        config = TunedConfig(_PARAMETERS, visibility=visibility)
        runtime = Runtime(self._scene, config, options, context=self._context)
        view = View("gather", "fitted", size, self._camera, self._lights)
        frame = runtime._draw(view)
        self._context.finish()
        return _Drawn(frame, view, frame_light_records(runtime.scene_buffers, view))


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A drawn frame, what it shows, and the lights that are bound."""

    frame: Frame
    view: View
    records: LightRecords


def _milliseconds(context: moderngl.Context, draw: Callable[[], object], repeats: int) -> float:
    """The best of some runs: by GPU timers, but by the wall clock on llvmpipe, where they under-report."""
    wall_clock = "llvmpipe" in context.info["GL_RENDERER"]
    best = np.inf
    for _ in range(repeats):
        if wall_clock:
            start = time.perf_counter()
            draw()
            context.finish()
            taken = 1e3 * (time.perf_counter() - start)
        else:
            query = context.query(time=True)
            with query:
                draw()
            taken = 1e-6 * query.elapsed
        best = min(best, taken)
    return best


def _gather_milliseconds(context: moderngl.Context, drawn: _Drawn, repeats: int) -> float:
    """Gather, and where it is interleaved, filter and the listed pixels' full gather."""
    camera = drawn.frame.camera(drawn.view)
    return _milliseconds(context, lambda: drawn.frame._gather(camera), repeats)


@dataclass(frozen=True, eq=False)
class _FullGather:
    """What an interleaved gather is measured against."""

    milliseconds: float
    image: np.ndarray


def _full_gather(context: moderngl.Context, drawn: _Drawn, repeats: int) -> _FullGather:
    milliseconds = _gather_milliseconds(context, drawn, repeats)
    return _FullGather(milliseconds, read_image(drawn.frame.vpl_irradiance))


def _interleaved_row(
    context: moderngl.Context, name: str, scene: _BenchmarkScene, visibility: Visibility, full: _FullGather
) -> Row:
    drawn = scene.drawn(SIZE, RuntimeOptions(interleave=4), visibility)
    milliseconds = _gather_milliseconds(context, drawn, repeats=3)
    error = _relative_error(read_image(drawn.frame.vpl_irradiance), full.image)
    maps = "with visibility maps" if visibility == "maps" else "without maps"
    return Row(name, milliseconds, "ms", f"gather_full, {maps}; relMSE {error:.2g}", full.milliseconds)


def _place(drawn: _Drawn) -> None:
    """From RSM to VPLs: densities, scene length and placement."""
    frame, origin = drawn.frame, drawn.records.moment_origin
    frame.virtual_point_lights.distribute(frame.rsm, origin)
    frame.virtual_point_lights.draw(frame.rsm, (0.0, 0.0))


def _readback_milliseconds(context: moderngl.Context, drawn: _Drawn) -> tuple[float, float, float]:
    """Reading the RSM back; making the VPLs of it; drawing them one by one. The first two wait."""
    readback = VplsReadback(context, drawn.frame, VPL_COUNT)
    context.finish()
    start = time.perf_counter()
    texels = readback.read()
    read = time.perf_counter()
    vpls = readback.place(texels, drawn.records)
    placed = time.perf_counter()
    readback.draw(drawn.view, vpls[:4], _PARAMETERS)
    one_by_one = _milliseconds(
        context, lambda: readback.draw(drawn.view, vpls[:READBACK_DRAWS], _PARAMETERS), repeats=1
    )
    return 1e3 * (read - start), 1e3 * (placed - read), one_by_one * VPL_COUNT / READBACK_DRAWS


def _indirect_milliseconds(context: moderngl.Context, drawn: _Drawn) -> float:
    """RSM, VPLs, gather, filter and screen-space near field: all that indirect light adds to a frame."""
    frame, camera = drawn.frame, drawn.frame.camera(drawn.view)

    def indirect_path() -> None:
        frame._reflective_shadow_map.draw(frame.rsm)
        _place(drawn)
        frame._gather(camera)
        frame._add_near_field(camera, len(drawn.view.lights), None)

    return _milliseconds(context, indirect_path, repeats=2)


def _relative_error(image: np.ndarray, reference: np.ndarray) -> float:
    """relMSE of irradiance (vpltune.tuner.metrics.view_metrics) where a surface is seen."""
    seen = reference[..., 3] > 0.0
    y, r = image[seen][:, :3].astype(np.float64), reference[seen][:, :3].astype(np.float64)
    return float(np.mean((y - r) ** 2 / (r**2 + 0.01 * r.mean() ** 2)))
