"""Milliseconds of every pass of a frame with interleaved gather, near field and 1,000 dynamic lights."""

from collections.abc import Callable

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import own_scene, scene_and_view
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.frame_timing import truthful_clock
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.light_motion import BouncingLights, flux_beside

SIZE = (640, 360)
"""Width and height of the image in pixels. A choice: a ninth of 1080p, for software renderers."""
LIGHT_COUNT = 1_000
"""Dynamic lights. A choice."""
FRAMES = 5
"""Timed frames, of which the median counts. A choice."""
CONFIG = TunedConfig(ArtistParameters(screen_space_strength=1.0), quality=Quality(interleave=4))
"""The defaults, with the optional passes switched on."""


def pass_rows(progress: Callable[[str, float], None]) -> list[Row]:
    """A row `pass_<name>` for each pass in the order of the frame, against the sum over all passes."""
    progress("passes", 0.0)
    scene, view = scene_and_view(own_scene("gallery"), SIZE)
    with create_context() as context:
        runtime = Runtime(scene, context=context)
        bouncing = BouncingLights(scene, LIGHT_COUNT, 0, flux_beside(scene, view.lights))
        milliseconds = runtime.pass_milliseconds(view, CONFIG, FRAMES, DynamicLights(bouncing.records))
        clock = truthful_clock(runtime.opengl_renderer)
    progress("passes", 1.0)
    against = f"all passes of a {SIZE[0]}x{SIZE[1]} frame with visibility maps ({clock} clock)"
    total = sum(milliseconds.values())
    return [Row(f"pass_{name}", value, "ms", against, total) for name, value in milliseconds.items()]
