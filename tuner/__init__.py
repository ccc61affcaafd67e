"""Fits the artist parameters of virtual point lights to a path-traced reference.

import tuner
result = tuner.fit("scene.glb", "out", views=2)   # tuner.FitResult
result.config                                     # what renderer.Runtime takes
"""

import importlib

_HOMES = {"fit": "tuner.fit_scene", "FitOptions": "tuner.fit_scene", "FitResult": "tuner.fit_scene"}


def __getattr__(name: str):
    # On demand: the command line imports this package for `--help`, and JAX takes its time.
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
