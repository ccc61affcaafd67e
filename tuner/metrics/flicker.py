"""Flicker: the change of an image when every light moves by one texel of its reflective shadow map.

Such a move hardly changes the true illumination, so the change is due to VPLs that jump.
"""

import math
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from vpltune.renderer.scene.placement.sight import frame_of
from vpltune.renderer.scene.scene import Light
from vpltune.renderer.scene.views import View

TEXELS = 1024
"""Texels along the side of a face, the runtime's default. On a coarser map the move is below a texel."""


def moved_by_a_texel(view: View, length_world: float) -> View:
    """The view with each light moved by one texel: point lights are shifted along +X, others are turned.

    Args:
        view: The view to change.
        length_world: Typical distance from a point light to the surfaces it lights, in world units: L of the
            frame.
    """
    return replace(view, lights=tuple(_moved(light, length_world) for light in view.lights))


def flicker(
    before: Float[np.ndarray, "height width 3"],
    after: Float[np.ndarray, "height width 3"],
    valid: Bool[np.ndarray, "height width"],
) -> float:
    """mean|E′ − E| ÷ mean E over the valid pixels of two irradiance images; 0 if the first is black."""
    level = float(before[valid].mean(dtype=np.float64)) if valid.any() else 0.0
    change = float(np.abs(after[valid].astype(np.float64) - before[valid]).mean()) if valid.any() else 0.0
    return change / level if level > 0.0 else 0.0


def _moved(light: Light, length_world: float) -> Light:
    if light.kind == "point":
        # A face of a cube map spans 90°.
        step = math.pi / 2.0 / TEXELS * length_world
        return replace(light, position_world=light.position_world + np.array([step, 0.0, 0.0]))
    # A directional light's face is about as wide as it is far away, so a texel spans an angle of 1/TEXELS.
    angle = 2.0 * light.outer_cone / TEXELS if light.kind == "spot" else 1.0 / TEXELS
    across, _ = frame_of(light.direction_world)
    return replace(light, direction_world=math.cos(angle) * light.direction_world + math.sin(angle) * across)
