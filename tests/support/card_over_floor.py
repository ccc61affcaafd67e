"""A card with alpha over a white floor, under a sun straight above, or between a lamp and a ceiling."""

from dataclasses import replace

import numpy as np
from built_scenes import quad

from vpltune.renderer.scene.scene import AlphaMode, Camera, Instance, Light, Material, Scene, Texture
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View

SUN = Light("directional", np.full(3, 3.0), direction_world=np.array([0.0, -1.0, 0.0]))
LAMP = Light("spot", np.full(3, 2.0), np.array([0.0, 0.45, 0.0]), np.array([0.0, -1.0, 0.0]), 0.5, 0.9)
"""Between floor and card."""


def checkered(texels: int = 8) -> Texture:
    """White; every second texel is opaque, and the others are holes."""
    row, column = np.indices((texels, texels))
    opacity = np.where((row + column) % 2 == 0, 255, 0).astype(np.uint8)
    return Texture("checkered", np.full((texels, texels, 3), 255, np.uint8), opacity=opacity)


def card_over_floor(
    mode: AlphaMode,
    opacity: float = 1.0,
    texture: Texture | None = None,
    cards: int = 1,
    *,
    has_ceiling: bool = False,
) -> Scene:
    """A floor of 4², over its middle cards of 2² at heights of 0.5, 0.6, …, and maybe a ceiling at 1."""
    floor = quad((-2, 0, -2), (0, 0, 4), (4, 0, 0), 0, "floor")
    uv = np.float32([[0, 0], [0, 1], [1, 1], [1, 0]])
    card = replace(quad((-1, 0.5, -1), (0, 0, 2), (2, 0, 0), 1, "card"), uv=uv)
    ceiling = quad((-1, 1, -1), (2, 0, 0), (0, 0, 2), 0, "ceiling")
    lifted = [np.eye(4) for _ in range(cards)]
    for i, matrix in enumerate(lifted):
        matrix[1, 3] = 0.1 * i
    instances = [Instance("floor", 0, np.eye(4)), *(Instance("card", 1, matrix) for matrix in lifted)]
    if has_ceiling:
        instances.append(Instance("ceiling", 2, np.eye(4)))
    white = Material("white", np.full(3, 0.8, np.float32))
    material = Material("card", np.full(3, 0.5, np.float32), None if texture is None else 0, mode, opacity)
    return Scene(
        name="card",
        meshes=(floor, card, ceiling),
        instances=tuple(instances),
        materials=(white, material),
        textures=() if texture is None else (texture,),
    )


def view_down(height: float, size: tuple[int, int] = (64, 64)) -> View:
    """Straight down: from 3, all of the card in the middle; from 0.45, the floor below it."""
    camera = Camera(look_at(np.array([0.01, height, 0.02]), np.array([0.01, 0.0, 0.02])), 1.0)
    return View("down", "fitted", size, camera, (SUN,))


def view_of_ceiling(size: tuple[int, int] = (48, 48)) -> View:
    """Straight up from over the cards, to the middle of the ceiling. The lamp is below the cards."""
    camera = Camera(look_at(np.array([0.01, 0.75, 0.02]), np.array([0.01, 1.0, 0.02])), 1.2)
    return View("ceiling", "fitted", size, camera, (LAMP,))
