"""Direct light of an even sky on a floor, against its closed form.

Each scene is drawn with its sky, whose direct light comes along rays, and with `LIGHTS` directional lights in
place of it, whose shadows come from their maps alone. A frame has few VPLs, so that most of its time is the
maps of the lights, which both need, and direct light.

`python -m benchmarks.quality.sky` prints the table.
"""

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from benchmarks.harness.processor_seconds import Drawing, check_software, seconds_in_turn
from benchmarks.harness.row import Row
from benchmarks.harness.sky_scenes import RADIANCE, SkyScene, sky_scenes
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import LightSettings
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.scene.environment import even_sky
from vpltune.renderer.scene.sky_lights import sky_lights

SIZES = ((96, 96), (640, 360))
"""Width and height of the images in pixels. A choice: the first has a block of few pixels, the second of
many."""
LIGHTS = 32
"""Lights that stand for the sky: the default."""
CONFIG = TunedConfig(
    ArtistParameters(vpl_count=16),
    quality=Quality(interleave=1, map_size=8),
    light=LightSettings(bounces=1, sky_lights=LIGHTS),
)
"""The config of every frame."""
REPEATS = 5
"""Frames of a timing, of which the median is taken. A choice."""


def rows(progress: Callable[[str, float], None]) -> Iterator[Row]:
    """Mean and error of the floor's irradiance, and processor time of a frame, by size and scene."""
    return measured_rows(progress, SIZES, REPEATS)


def measured_rows(
    progress: Callable[[str, float], None], sizes: tuple[tuple[int, int], ...], repeats: int
) -> Iterator[Row]:
    """The rows of images of these sizes."""
    with create_context() as context:
        cases = [(size, scene) for size in sizes for scene in sky_scenes(size)]
        for index, (size, scene) in enumerate(cases):
            name = f"{size[0]}x{size[1]}.{scene.name}"
            progress(f"sky, {name}", index / len(cases))
            dark = replace(scene.scene, environment=None)
            lit = replace(scene.view, lights=sky_lights(even_sky(RADIANCE), LIGHTS).lights)
            drawings: dict[str, Drawing] = {
                "rays": (Runtime(scene.scene, context=context), scene.view, CONFIG),
                "maps": (Runtime(dark, context=context), lit, CONFIG),
            }
            check_software(drawings["rays"][0], "sky")
            means, errors = zip(*(errors_of(scene, drawing) for drawing in drawings.values()), strict=True)
            seconds = seconds_in_turn(drawings, repeats)
            maps = f"{LIGHTS} lights with maps"
            yield Row(f"{name}.mean", means[0], "of the exact", maps, means[1])
            yield Row(f"{name}.rms", errors[0], "of the mean", maps, errors[1])
            yield Row(f"{name}.time", seconds["rays"], "s of processor time", maps, seconds["maps"])
    progress("sky", 1.0)


def errors_of(scene: SkyScene, drawing: Drawing) -> tuple[float, float]:
    """Mean of the floor's direct light ÷ the exact one, and RMS of its error ÷ the exact mean."""
    runtime, view, config = drawing
    frame = runtime.capture(view, config, maps=False)
    floor = scene.floor(frame)
    exact = scene.exact(frame.position_world[floor])
    got = (frame.direct_irradiance[floor] / np.array(RADIANCE)).mean(axis=1, dtype=np.float64)
    return float(got.mean() / exact.mean()), float(np.sqrt(((got - exact) ** 2).mean()) / exact.mean())


def table(made: list[Row]) -> str:
    """A Markdown table: of each scene and size, the figures of rays and of maps."""
    found = {row.name: row for row in made}
    lines = [
        "| scene | size | mean ÷ exact, rays | maps | error ÷ mean, rays | maps | time, rays ÷ maps |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in dict.fromkeys(row.name.rpartition(".")[0] for row in made):
        size, scene = name.split(".")
        mean, rms, seconds = (found[f"{name}.{figure}"] for figure in ("mean", "rms", "time"))
        errors = (mean.value, mean.against_value, rms.value, rms.against_value)
        cells = " | ".join(f"{each:.3f}" for each in errors)
        label = f"{scene.replace('_', ' ')} | {size.replace('x', '×')}"
        lines.append(f"| {label} | {cells} | {seconds.ratio:.2f} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(table(list(rows(lambda stage, share: print(f"{share:.0%} {stage}", file=sys.stderr)))))
