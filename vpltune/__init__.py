"""VPLtune: one-bounce indirect light from virtual point lights, fitted to a path tracer.

    import vpltune

    result = vpltune.fit("scene.glb", "out")                  # needs vpltune[tuner]
    runtime = vpltune.Runtime(vpltune.read_scene("scene.glb"))
    image = runtime.render(view, vpltune.read_config("out/tuned.json"))

Names are imported when they are first used: reading a config loads neither OpenGL nor JAX.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vpltune.renderer.config.tuned_config import TunedConfig, read_config
    from vpltune.renderer.frame.runtime import Runtime
    from vpltune.renderer.scene.files import read_scene
    from vpltune.renderer.scene.views import View, read_views
    from vpltune.tuner import surrogate
    from vpltune.tuner.scene_fit.fit_scene import FitOptions, FitResult, fit
    from vpltune.window.notebook import Window, view

__all__ = [
    "FitOptions",
    "FitResult",
    "Runtime",
    "TunedConfig",
    "View",
    "Window",
    "fit",
    "read_config",
    "read_scene",
    "read_views",
    "surrogate",
    "view",
]

_HOMES = {
    "FitOptions": "vpltune.tuner.scene_fit.fit_scene",
    "FitResult": "vpltune.tuner.scene_fit.fit_scene",
    "Runtime": "vpltune.renderer.frame.runtime",
    "TunedConfig": "vpltune.renderer.config.tuned_config",
    "View": "vpltune.renderer.scene.views",
    "Window": "vpltune.window.notebook",
    "fit": "vpltune.tuner.scene_fit.fit_scene",
    "read_config": "vpltune.renderer.config.tuned_config",
    "read_scene": "vpltune.renderer.scene.files",
    "read_views": "vpltune.renderer.scene.views",
    "view": "vpltune.window.notebook",
}


def __getattr__(name: str):
    if name == "surrogate":
        return importlib.import_module("vpltune.tuner.surrogate")
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
