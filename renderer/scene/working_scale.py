"""The scale that a scene is drawn in: its lengths' fourth powers and its lights stay within float32."""

import math
from collections.abc import Iterable

import numpy as np

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files.limits import LARGEST_RADIOMETRIC
from vpltune.renderer.scene.scene import Light, Scene, scaled_light

DRAWN_AS_IT_IS = 2.0**20
"""A scene whose diagonal is in [1/DRAWN_AS_IT_IS, DRAWN_AS_IT_IS] is drawn in world units. A choice: 1e6
metres, far within the 1e9 at which indirect light begins to be lost."""


def working_scale(scene: Scene) -> float:
    """What lengths are multiplied by: 1, or the power of two that makes the diagonal about 1.

    A power of two changes no digit of a coordinate.
    """
    low, high = scene.bounds()
    return scale_of(float(np.linalg.norm(high - low)))


def scale_of(diagonal: float) -> float:
    """The working scale of a scene whose diagonal is so many world units."""
    if not 0.0 < diagonal < math.inf or 1.0 / DRAWN_AS_IT_IS <= diagonal <= DRAWN_AS_IT_IS:
        return 1.0
    return 2.0 ** -round(math.log2(diagonal))


def too_strong(lights: Iterable[Light], diagonal: float) -> str | None:
    """What is wrong with the first light that is too strong to draw; None if all can be drawn.

    The limit is one of the light as it is drawn. A spot that lights a room of 1e10 units as another lights
    one of 1 unit is 1e20 times as strong.

    Args:
        lights: in world units.
        diagonal: of the scene, in world units.
    """
    scale = scale_of(diagonal)
    for number, light in enumerate(lights):
        strongest = float(light.intensity.max())
        drawn = float(scaled_light(light, scale).intensity.max())
        if not drawn <= LARGEST_RADIOMETRIC:
            unit = "W/m²" if light.kind == "directional" else "W/sr"
            most = LARGEST_RADIOMETRIC * strongest / drawn
            return (
                f"light {number} {light.name!r:.60}: intensity must be at most {most:.3g} {unit} in a scene "
                f"{diagonal:.3g} units across, got {strongest:.3g}"
            )
    return None


def require_drawable(lights: Iterable[Light], scene: Scene, where: str) -> None:
    """Check that no light is too strong for a scene; `where` is what the lights come from.

    Raises:
        InputError: one is.
    """
    low, high = scene.bounds()
    fault = too_strong(lights, float(np.linalg.norm(high - low)))
    if fault is not None:
        raise InputError(f"{where}: {fault}")
