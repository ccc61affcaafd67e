"""Views whose reference is the runtime's own picture with very many VPLs."""

import numpy as np
from built_scenes import ROOM_LIGHTS

from renderer.artist_parameters import ArtistParameters
from renderer.runtime import Runtime
from renderer.scene import Camera, look_at
from renderer.views import View
from tuner.captured_view import CapturedView
from tuner.reference.reference_view import ReferenceView

MANY = ArtistParameters(vpl_count=16384, falloff_footprint=0.1)
"""Whose picture stands for the path tracer's: it holds all that falloff and placement can be wrong about."""


def corner_view(light: str, size=(32, 24)) -> View:
    """From inside, close to a corner away from most of what is lit."""
    camera = Camera(look_at(np.array([0.1, -0.3, 0.4]), np.array([1.0, -0.9, -1.0])), 0.9)
    return View(light, "fitted", size, camera, (ROOM_LIGHTS[light],))


def converged_view(runtime: Runtime, light: str) -> CapturedView:
    view = corner_view(light, (24, 18))
    runtime.parameters = MANY
    captured = runtime.capture(view)
    picture = captured.indirect_irradiance
    reference = ReferenceView(
        irradiance_a=picture,
        irradiance_b=picture,
        direct_irradiance=captured.direct_irradiance,
        albedo=captured.albedo,
        position_world=captured.position_world.astype(np.float64),
        normal_world=captured.normal_world,
        valid=captured.valid,
        samples=1,
    )
    return CapturedView(view, reference, captured)
