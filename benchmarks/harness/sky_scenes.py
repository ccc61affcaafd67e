"""Scenes under an even sky whose direct light is known in closed form at every point of the floor."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64

from benchmarks.harness.polygon_irradiance import polygon_irradiance
from vpltune.renderer.frame.capture import CapturedFrame
from vpltune.renderer.scene.environment import even_sky
from vpltune.renderer.scene.scene import Camera, Instance, Material, Scene
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View
from vpltune.tuner.prior.scene_generator import parallelograms

RADIANCE = (3.0, 2.0, 1.0)
"""Radiance of the sky, W/(m² sr). A choice: channels can be told apart."""
_UP = np.array([0.0, 1.0, 0.0])
_FLOOR_HEIGHT = 0.01
"""Largest height of a pixel of the floor, which is at 0. A choice: nothing else is so low, but edges."""


@dataclass(frozen=True, eq=False)
class SkyScene:
    """A floor at height 0, with a polygon that it sees the sky through, or that hides it."""

    name: str
    scene: Scene
    view: View
    polygon: Float64[np.ndarray, "corners 3"]
    hides: bool = False
    """Whether the polygon hides the sky, of which all else is seen. Otherwise no other sky is seen."""

    def floor(self, frame: CapturedFrame) -> Bool[np.ndarray, "height width"]:
        """The pixels that see the floor."""
        return (
            frame.valid & (frame.position_world[..., 1] < _FLOOR_HEIGHT) & (frame.normal_world[..., 1] > 0.9)
        )

    def exact(self, points: Float[np.ndarray, "points 3"]) -> Float[np.ndarray, " points"]:
        """E ÷ L at points of the floor: of the polygon, or of the whole sky less the polygon."""
        part = polygon_irradiance(self.polygon, points.astype(np.float64), _UP)
        return np.pi - part if self.hides else part


def sky_scenes(size: tuple[int, int]) -> tuple[SkyScene, ...]:
    """A well, a room with a small and with a large window, and ground under a table, in views of `size`."""
    return (
        well(size),
        room("small_window", size, (0.8, 1.6), 0.5),
        room("large_window", size, (0.3, 1.8), 1.6),
        table(size),
    )


def well(size: tuple[int, int]) -> SkyScene:
    """A square of side 2 at the bottom of walls as high, seen from above."""
    quads = [
        [(-1, 0, -1), (0, 0, 2), (2, 0, 0)],
        [(-1, 0, -1), (2, 0, 0), (0, 2, 0)],
        [(-1, 0, 1), (0, 2, 0), (2, 0, 0)],
        [(-1, 0, -1), (0, 2, 0), (0, 0, 2)],
        [(1, 0, -1), (0, 0, 2), (0, 2, 0)],
    ]
    opening = [(-1, 2, -1), (1, 2, -1), (1, 2, 1), (-1, 2, 1)]
    return _made("well", quads, _view(size, (0.0, 3.9, 0.001), (0.0, 0.0, 0.0), 0.5), opening)


def room(name: str, size: tuple[int, int], heights: tuple[float, float], half_width: float) -> SkyScene:
    """A closed room of 4 × 2 × 4 with one window in the wall at x = 2, from one height to the other."""
    low, high = heights
    rest = 2.0 - half_width
    quads = [
        [(-2, 0, -2), (0, 0, 4), (4, 0, 0)],
        [(-2, 2, -2), (4, 0, 0), (0, 0, 4)],
        [(-2, 0, -2), (4, 0, 0), (0, 2, 0)],
        [(-2, 0, 2), (0, 2, 0), (4, 0, 0)],
        [(-2, 0, -2), (0, 2, 0), (0, 0, 4)],
        [(2, 0, -2), (0, 0, 4), (0, low, 0)],
        [(2, high, -2), (0, 0, 4), (0, 2 - high, 0)],
        [(2, low, -2), (0, 0, rest), (0, high - low, 0)],
        [(2, low, half_width), (0, 0, rest), (0, high - low, 0)],
    ]
    window = [(2, low, -half_width), (2, high, -half_width), (2, high, half_width), (2, low, half_width)]
    return _made(name, quads, _view(size, (-1.0, 1.8, 0.0), (0.6, 0.0, 0.0), 1.0), window)


def table(size: tuple[int, int]) -> SkyScene:
    """A square of side 2 at height 1 over open ground."""
    quads = [[(-10, 0, -10), (0, 0, 20), (20, 0, 0)], [(-1, 1, -1), (2, 0, 0), (0, 0, 2)]]
    top = [(-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1)]
    view = _view(size, (0.0, 0.5, 3.0), (0.0, 0.0, 0.0), 0.8)
    return _made("under_table", quads, view, top, hides=True)


def _made(name: str, quads: list, view: View, polygon: list, *, hides: bool = False) -> SkyScene:
    scene = Scene(
        name=name,
        meshes=(parallelograms(name, np.array(quads, np.float64), 0),),
        instances=(Instance(name, 0, np.eye(4)),),
        materials=(Material("grey", np.full(3, 0.5, np.float32)),),
        environment=even_sky(RADIANCE),
    )
    return SkyScene(name, scene, view, np.array(polygon, np.float64), hides)


def _view(
    size: tuple[int, int],
    eye: tuple[float, float, float],
    target: tuple[float, float, float],
    yfov: float,
) -> View:
    return View("sky", "fitted", size, Camera(look_at(list(eye), list(target)), yfov), ())
