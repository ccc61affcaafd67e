"""Views whose reference is the runtime's own image with very many VPLs."""

import numpy as np
from built_scenes import ROOM_LIGHTS
from own_reference import own_reference
from point_vpls import point_vpls

from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import Camera
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View
from vpltune.tuner.surrogate.captured_view import CapturedView

MANY = point_vpls(vpl_count=16384, falloff_footprint=0.1)
"""Whose image stands for the path tracer's: it holds all that falloff and placement can be wrong about."""

DEFAULT = TunedConfig(light=ONE_BOUNCE)


def corner_view(light: str, size=(32, 24)) -> View:
    """From inside, close to a corner away from most of what is lit."""
    camera = Camera(look_at(np.array([0.1, -0.3, 0.4]), np.array([1.0, -0.9, -1.0])), 0.9)
    return View(light, "fitted", size, camera, (ROOM_LIGHTS[light],))


def converged_view(runtime: Runtime, light: str, config: TunedConfig = DEFAULT) -> CapturedView:
    """Drawn as `config` says, with the parameters `MANY`."""
    view = corner_view(light, (24, 18))
    captured = runtime.capture(view, config.with_parameters(MANY))
    return CapturedView(view, own_reference(captured), captured)
