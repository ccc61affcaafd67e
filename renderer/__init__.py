"""The real-time runtime: numpy and OpenGL only, never jax or mitsuba.

import renderer
runtime = renderer.Runtime(renderer.read_scene(path), "tuned.json")
picture = runtime.render(view)   # [height, width, 3], uint8, sRGB
"""

import importlib

_HOMES = {
    "Runtime": "renderer.runtime",
    "TunedConfig": "renderer.tuned_config",
    "View": "renderer.views",
    "read_config": "renderer.tuned_config",
    "read_scene": "renderer.scene_file",
    "read_views": "renderer.views",
}


def __getattr__(name: str):
    # On demand: reading a config must not load OpenGL.
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
