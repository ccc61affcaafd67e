"""A scene prepared for ray tracing with the Mitsuba variant that works on this machine."""

import functools
from dataclasses import dataclass
from typing import Any

from vpltune.renderer.scene.scene import Scene
from vpltune.tuner.reference.emitted_light import EmittedLight, emitted_light
from vpltune.tuner.reference.surfaces import Surfaces
from vpltune.tuner.reference.unit_triangles import UnitTriangles, unit_triangles
from vpltune.tuner.reference.variant import select_variant


@dataclass(frozen=True, eq=False)
class TracedScene:
    """One scene, loaded onto one wavefront."""

    triangles: UnitTriangles
    wavefront: Any
    """`LlvmWavefront` or `NumpyWavefront`. They have the same methods and hold the acceleration structure."""
    surfaces: Surfaces
    emitted: EmittedLight | None
    """Light of glowing surfaces and of the environment; None without either."""


def traced_scene(scene: Scene) -> TracedScene:
    """Prepare a scene for ray tracing. The most recent scene is cached.

    Raises:
        InputError: the scene has no triangles, an index in it is out of range, or a radiance is negative or
            not finite.
    """
    return _traced_scene(scene, select_variant().name)


@functools.lru_cache(maxsize=1)
def _traced_scene(scene: Scene, variant: str) -> TracedScene:
    # Dr.Jit's array types depend on the variant, so a module is imported only while its variant is current.
    if variant == "scalar_rgb":
        from vpltune.tuner.reference.numpy_wavefront import NumpyWavefront as Wavefront
    else:
        from vpltune.tuner.reference.llvm_wavefront import LlvmWavefront as Wavefront
    triangles = unit_triangles(scene)
    wavefront = Wavefront(triangles)
    surfaces = Surfaces(wavefront, triangles)
    return TracedScene(triangles, wavefront, surfaces, emitted_light(surfaces, triangles, scene.environment))
