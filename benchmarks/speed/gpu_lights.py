"""Dynamic lights in tiles and as volumes, against their limit and against a draw for each light."""

import time
from collections.abc import Iterator
from dataclasses import replace

from benchmarks.harness.row import Row
from benchmarks.speed.gpu_frames import SIZES, MeasuredScene, Series
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime_options import LightPath, RuntimeOptions
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.light_motion import BouncingLights, flux_beside
from vpltune.renderer.techniques.light_per_draw import LightPerDrawPass

LIGHT_SIZE = "1080p"
LIGHT_COUNTS = (1_000, 10_000, 100_000)
"""Dynamic lights. A choice."""
LIGHT_PATHS: tuple[LightPath, ...] = ("tiles", "volumes")
LIGHT_ROWS = len(LIGHT_PATHS) * len(LIGHT_COUNTS) + 1
RANGE = 1.0 / 40.0
"""Range of every point light in diagonals of the scene; spots reach twice as far. A choice: the same for all
counts, so that ten times the lights are ten times the work."""
PER_DRAW_LIGHTS = 100
"""Lights that are drawn one by one. A choice: each covers the whole image."""
WARM_UP_LIGHTS = 10
"""Lights of an untimed draw before. A choice."""
PRE_PASS_CONFIG = TunedConfig(
    ArtistParameters(vpl_count=1),
    visibility="transmittance",
    quality=Quality(rsm_resolution=64),
    light=ONE_BOUNCE,
)
"""As little beside the light pre-pass as a frame can have."""


def light_rows(measured: MeasuredScene) -> Iterator[Row]:
    """A row of the light pre-pass for each way and count, and one for a draw of each light."""
    view = measured.sized(SIZES[LIGHT_SIZE])
    tiles_per_light = 0.0
    for path in LIGHT_PATHS:
        series = Series(measured.timing)
        for count in LIGHT_COUNTS:
            name = f"lights.{LIGHT_SIZE}.{count}_{path}"
            if series.too_long(count):
                yield series.left_out(name, count)
                continue
            runtime = measured.runtime(RuntimeOptions(light_path=path))
            lights = DynamicLights(moving_lights(measured, count).records)
            drawn = runtime.draw(view, PRE_PASS_CONFIG, lights=lights)
            taken = measured.pass_milliseconds(drawn)["light_pre_pass"]
            series.note(count, taken)
            if path == "tiles":
                tiles_per_light = taken / count
            limit = measured.limits(drawn, PRE_PASS_CONFIG)["light_pre_pass"]
            yield Row(name, taken, "ms", measured.against_limit, limit)
    yield Row(
        f"lights.{LIGHT_SIZE}.per_light_tiles",
        tiles_per_light,
        "ms",
        "one draw per light over the whole image, wall clock",
        per_draw_milliseconds(measured),
    )


def moving_lights(measured: MeasuredScene, count: int) -> BouncingLights:
    """Lights that bounce through the scene."""
    low, high = measured.scene.bounds()
    reach = RANGE * float(((high - low) ** 2).sum() ** 0.5)
    flux = flux_beside(measured.scene, measured.view.lights)
    return BouncingLights(measured.scene, count, 0, flux, reach)


def per_draw_milliseconds(measured: MeasuredScene) -> float:
    """Milliseconds of a light that is drawn over the whole image by itself."""
    records = moving_lights(measured, PER_DRAW_LIGHTS).records
    runtime = measured.runtime(RuntimeOptions(light_path="tiles"))
    view = measured.sized(SIZES[LIGHT_SIZE])
    drawn = runtime.draw(view, PRE_PASS_CONFIG, lights=DynamicLights(records))
    light_pass, context = LightPerDrawPass(drawn.frame.resources), measured.context
    light_pass.draw(replace(drawn.inputs, dynamic_lights=DynamicLights(records[:WARM_UP_LIGHTS])))
    context.finish()
    start = time.perf_counter()
    light_pass.draw(drawn.inputs)
    context.finish()
    return 1e3 * (time.perf_counter() - start) / len(records)
