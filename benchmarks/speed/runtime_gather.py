"""VPL placement, gather and the whole indirect path: interleaved against full, GPU against read-back.

Milliseconds are medians of a few frames, pass by pass. A row that covers several passes is their sum. The sum
is an upper bound, because passes overlap in a real frame.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import present_scenes, scene_and_view
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig, Visibility
from vpltune.renderer.frame.capture import read_image
from vpltune.renderer.frame.frame_timing import frame_milliseconds
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.techniques.vpls_readback import VplsReadback
from vpltune.tuner.metrics.view_metrics import relmse

SIZE = (640, 360)
"""Width and height of the image in pixels. A choice: a ninth of 1080p, for software renderers."""
SIZE_1080P = (1920, 1080)
"""Width and height of the image of the row `frame_1080p_1024vpl`."""
VPL_COUNT = 1024
"""VPLs: the default count."""
INTERLEAVE = 4
"""Pixels along the side of an interleaved block. A choice."""
FRAMES = 2
"""Timed frames after one that is not timed. A choice: a software renderer needs seconds for one."""
READBACK_DRAWS = 128
"""VPLs that are drawn one by one; their time is scaled to `VPL_COUNT`. A choice."""
WARM_UP_DRAWS = 4
"""VPLs of an untimed draw before. A choice."""
HARD_SCENES = ("sketchfab-macross-diorama", "playcanvas-chess-board", "bevy-mixedlightingexample")
"""The hardest scenes for interleaving: in windows on small parts and round objects, subsets are missing."""
TARGET_MS = 1.0
"""Target for the whole indirect path at 1080p with 1,024 VPLs on a data-centre GPU, in milliseconds."""
PLACEMENT_PASSES = ("virtual_point_lights",)
GATHER_PASSES = ("vpl_gather", "interleaved_filter")
INDIRECT_PASSES = (
    "reflective_shadow_map",
    *PLACEMENT_PASSES,
    *GATHER_PASSES,
    "screen_space_indirect",
    "screen_space_filter",
)
"""All passes that indirect light adds to a frame without visibility maps."""


def gather_rows(progress: Callable[[str, float], None]) -> list[Row]:
    """The rows of placement, gather and the indirect path."""
    with create_context() as context:
        return _rows(context, progress)


def _rows(context: moderngl.Context, progress: Callable[[str, float], None]) -> list[Row]:
    paths = present_scenes()
    progress("full gather", 0.0)
    scene = _MeasuredScene(context, paths["gallery"])
    full = scene.milliseconds(SIZE, _config(1))
    gather = _sum(full, GATHER_PASSES)
    progress("one draw for each VPL", 0.25)
    read, placed, one_by_one = scene.readback_milliseconds(_config(1))
    progress("interleaved gather", 0.4)
    rows = [
        scene.interleaved_row("gather_interleaved_4x4", "transmittance", gather),
        Row(
            "gather_full",
            gather,
            "ms",
            f"one additive draw per VPL, from {READBACK_DRAWS}, without maps",
            one_by_one,
        ),
        Row(
            "vpls_gpu",
            _sum(full, PLACEMENT_PASSES),
            "ms",
            f"vpls_readback: RSM read back {read:.3g} ms, Poisson-disc VPLs made on the CPU",
            read + placed,
        ),
    ]
    progress("indirect path at 1080p", 0.45)
    whole = _sum(scene.milliseconds(SIZE_1080P, _config(INTERLEAVE, near_field=True)), INDIRECT_PASSES)
    rows.append(
        Row("frame_1080p_1024vpl", whole, "ms", "target on a data-centre GPU, without maps", TARGET_MS)
    )
    modes: tuple[Visibility, ...] = ("transmittance", "maps")
    others: list[tuple[str, Visibility]] = [("gallery", "maps")]
    others.extend((name, mode) for name in HARD_SCENES for mode in modes if name in paths)
    for index, (name, mode) in enumerate(others):
        progress(f"interleaved gather, {name}", 0.6 + 0.4 * index / len(others))
        suffix = "_maps" if mode == "maps" else ""
        scene = _MeasuredScene(context, paths[name])
        gather = _sum(scene.milliseconds(SIZE, _config(1, mode)), GATHER_PASSES)
        rows.append(scene.interleaved_row(f"gather_interleaved_4x4_{name}{suffix}", mode, gather))
    return rows


def _config(
    interleave: int, visibility: Visibility = "transmittance", *, near_field: bool = False
) -> TunedConfig:
    parameters = ArtistParameters(vpl_count=VPL_COUNT, screen_space_strength=1.0 if near_field else 0.0)
    return TunedConfig(parameters, visibility=visibility, quality=Quality(interleave=interleave))


def _sum(milliseconds: dict[str, float], passes: Sequence[str]) -> float:
    """The milliseconds of those of `passes` that ran."""
    return sum(milliseconds.get(name, 0.0) for name in passes)


class _MeasuredScene:
    """A scene on the GPU, seen by its own camera and lights, or by placed ones where it has none."""

    def __init__(self, context: moderngl.Context, path: Path):
        self._context = context
        scene, self._view = scene_and_view(path, SIZE)
        self._runtime = Runtime(scene, context=context)

    def milliseconds(self, size: tuple[int, int], config: TunedConfig) -> dict[str, float]:
        """Milliseconds of each pass of an image of `size` pixels."""
        return self._runtime.pass_milliseconds(replace(self._view, size=size), config, FRAMES)

    def interleaved_row(self, name: str, visibility: Visibility, full: float) -> Row:
        """The interleaved gather with its filter, against the `full` milliseconds of a full gather."""
        config = _config(INTERLEAVE, visibility)
        taken = _sum(self.milliseconds(SIZE, config), GATHER_PASSES)
        image, expected = self._image(config), self._image(_config(1, visibility))
        seen = expected[..., 3] > 0.0
        error = relmse(image[seen][:, :3], expected[seen][:, :3])
        maps = "with visibility maps" if visibility == "maps" else "without maps"
        return Row(name, taken, "ms", f"gather_full, {maps}; relMSE {error:.2g}", full)

    def readback_milliseconds(self, config: TunedConfig) -> tuple[float, float, float]:
        """Milliseconds to read the RSM back, to make VPLs of it on the CPU, and to draw all of them.

        The first two block the CPU until the GPU is idle.
        """
        drawn, context = self._runtime.draw(self._view, config), self._context
        readback = VplsReadback(drawn.frame, VPL_COUNT)
        context.finish()
        start = time.perf_counter()
        texels = readback.read()
        read = time.perf_counter()
        vpls = readback.place(texels, drawn.inputs.records)
        placed = time.perf_counter()
        readback.draw(drawn.inputs, vpls[:WARM_UP_DRAWS])
        draws = frame_milliseconds(
            context, lambda: readback.draw(drawn.inputs, vpls[:READBACK_DRAWS]), frames=1
        )
        return 1e3 * (read - start), 1e3 * (placed - read), draws * VPL_COUNT / READBACK_DRAWS

    def _image(self, config: TunedConfig) -> np.ndarray:
        """The irradiance of the VPLs, RGBA; alpha is 1 where the camera sees a surface."""
        drawn = self._runtime.draw(self._view, config)
        return read_image(drawn.frame.resources, "vpl_irradiance")
