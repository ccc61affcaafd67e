"""VPLtune: indirect light from virtual point lights, fitted to a path tracer.

    import vpltune

    result = vpltune.fit("scene.glb", "out")                  # needs vpltune[tuner]
    runtime = vpltune.Runtime(vpltune.read_scene("scene.glb"))
    image = runtime.render(result.views[0], result.config)    # [height, width, 3], uint8, sRGB

Scenes:   read_scene, scene_from_arrays, scene_from_trimesh; Scene, Camera, Light, look_at
Views:    View, read_views
Configs:  TunedConfig, ArtistParameters, read_config, write_config
Images:   Runtime
Fits:     fit, FitResult, FitOptions; surrogate, the gather in JAX
Windows:  view, Window
Errors:   InputError, MachineError

Names are imported when they are first used: reading a config loads neither OpenGL nor JAX.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vpltune.renderer.config.artist_parameters import ArtistParameters
    from vpltune.renderer.config.tuned_config import TunedConfig, read_config, write_config
    from vpltune.renderer.errors import InputError, MachineError
    from vpltune.renderer.frame.runtime import Runtime
    from vpltune.renderer.scene.array_scene import scene_from_arrays
    from vpltune.renderer.scene.files import read_scene
    from vpltune.renderer.scene.scene import Camera, Light, Scene
    from vpltune.renderer.scene.transforms import look_at
    from vpltune.renderer.scene.trimesh_scene import scene_from_trimesh
    from vpltune.renderer.scene.views import View, read_views
    from vpltune.tuner import surrogate
    from vpltune.tuner.scene_fit.fit_result import FitResult
    from vpltune.tuner.scene_fit.fit_scene import FitOptions
    from vpltune.tuner.scene_fit.python_fit import fit
    from vpltune.window.notebook import Window, view

__all__ = [
    "ArtistParameters",
    "Camera",
    "FitOptions",
    "FitResult",
    "InputError",
    "Light",
    "MachineError",
    "Runtime",
    "Scene",
    "TunedConfig",
    "View",
    "Window",
    "fit",
    "look_at",
    "read_config",
    "read_scene",
    "read_views",
    "scene_from_arrays",
    "scene_from_trimesh",
    "surrogate",
    "view",
    "write_config",
]

_HOMES = {
    "ArtistParameters": "vpltune.renderer.config.artist_parameters",
    "Camera": "vpltune.renderer.scene.scene",
    "FitOptions": "vpltune.tuner.scene_fit.fit_scene",
    "FitResult": "vpltune.tuner.scene_fit.fit_result",
    "InputError": "vpltune.renderer.errors",
    "Light": "vpltune.renderer.scene.scene",
    "MachineError": "vpltune.renderer.errors",
    "Runtime": "vpltune.renderer.frame.runtime",
    "Scene": "vpltune.renderer.scene.scene",
    "TunedConfig": "vpltune.renderer.config.tuned_config",
    "View": "vpltune.renderer.scene.views",
    "Window": "vpltune.window.notebook",
    "fit": "vpltune.tuner.scene_fit.python_fit",
    "look_at": "vpltune.renderer.scene.transforms",
    "read_config": "vpltune.renderer.config.tuned_config",
    "read_scene": "vpltune.renderer.scene.files",
    "read_views": "vpltune.renderer.scene.views",
    "scene_from_arrays": "vpltune.renderer.scene.array_scene",
    "scene_from_trimesh": "vpltune.renderer.scene.trimesh_scene",
    "write_config": "vpltune.renderer.config.tuned_config",
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
