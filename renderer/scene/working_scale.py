"""The scale that a scene is drawn in, so that its lengths' fourth powers stay within float32."""

import math

import numpy as np

from vpltune.renderer.scene.scene import Scene

DRAWN_AS_IT_IS = 2.0**20
"""A scene whose diagonal is in [1/DRAWN_AS_IT_IS, DRAWN_AS_IT_IS] is drawn in world units. A choice: 1e6
metres, far within the 1e9 at which indirect light begins to be lost."""


def working_scale(scene: Scene) -> float:
    """What lengths are multiplied by: 1, or the power of two that makes the diagonal about 1.

    A power of two changes no digit of a coordinate.
    """
    low, high = scene.bounds()
    diagonal = float(np.linalg.norm(high - low))
    if not 0.0 < diagonal < math.inf or 1.0 / DRAWN_AS_IT_IS <= diagonal <= DRAWN_AS_IT_IS:
        return 1.0
    return 2.0 ** -round(math.log2(diagonal))
