"""Every pass of one frame: interleaved gather, screen-space near field and 1,000 dynamic lights."""

from collections.abc import Callable
from pathlib import Path

from benchmarks.harness.row import Row
from vpltune import configs
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.frame_timing import truthful_clock
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.scene.dynamic_lights import DynamicLights
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.light_motion import BouncingLights, flux_beside
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.views import View

SIZE = (640, 360)
LIGHT_COUNT = 1_000
FRAMES = 5


def pass_rows(progress: Callable[[str, float], None]) -> list[Row]:
    """A row `pass_<name>` for each pass, in the order of the frame, against the sum of them all."""
    progress("passes", 0.0)
    path = Path(configs.__file__).parent / "scenes" / "gallery.glb"
    scene = read_scene(path)
    camera, lights, _ = resolve_camera_and_lights(scene, path, None, None)
    view = View("passes", "fitted", SIZE, camera, lights)
    parameters = ArtistParameters(screen_space_strength=1.0)
    with create_context() as context:
        config = TunedConfig(parameters, visibility="maps")
        runtime = Runtime(scene, config, RuntimeOptions(interleave=4), context=context)
        bouncing = BouncingLights(scene, LIGHT_COUNT, 0, flux_beside(scene, lights))
        milliseconds = runtime.pass_milliseconds(view, FRAMES, DynamicLights(bouncing.records))
        clock = truthful_clock(str(context.info["GL_RENDERER"]))
    progress("passes", 1.0)
    against = f"all passes of a {SIZE[0]}x{SIZE[1]} frame with visibility maps ({clock} clock)"
    total = sum(milliseconds.values())
    return [Row(f"pass_{name}", value, "ms", against, total) for name, value in milliseconds.items()]
