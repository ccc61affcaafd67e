"""How unsteady an image is: what moving every light by a texel of its reflective shadow map changes.

The light itself changes by next to nothing then, so what an image changes by is the VPLs' own jumping about.
"""

import math
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from vpltune.renderer.scene.placement.sight import frame_of
from vpltune.renderer.scene.scene import Light
from vpltune.renderer.scene.views import View

TEXELS = 1024
"""Along the side of a face, as the runtime has by default; a coarser map moves by less than a texel."""


def moved_by_a_texel(view: View, length_world: float) -> View:
    """The view with its lights turned, or point lights shifted, by one texel.

    Args:
        length_world: how far from a point light its light falls, about; L of the frame.
    """
    return replace(view, lights=tuple(_moved(light, length_world) for light in view.lights))


def flicker(
    before: Float[np.ndarray, "height width 3"],
    after: Float[np.ndarray, "height width 3"],
    valid: Bool[np.ndarray, "height width"],
) -> float:
    """mean|E′ − E| over mean E of two images of indirect irradiance; 0 where nothing is lit."""
    level = float(before[valid].mean(dtype=np.float64)) if valid.any() else 0.0
    change = float(np.abs(after[valid].astype(np.float64) - before[valid]).mean()) if valid.any() else 0.0
    return change / level if level > 0.0 else 0.0


def _moved(light: Light, length_world: float) -> Light:
    if light.kind == "point":
        # A face of a cube map opens by a right angle.
        step = math.pi / 2.0 / TEXELS * length_world
        return replace(light, position_world=light.position_world + np.array([step, 0.0, 0.0]))
    # A directional light's face is about as long as it is far: a texel of it is seen under 1/TEXELS.
    angle = 2.0 * light.outer_cone / TEXELS if light.kind == "spot" else 1.0 / TEXELS
    across, _ = frame_of(light.direction_world)
    return replace(light, direction_world=math.cos(angle) * light.direction_world + math.sin(angle) * across)
