"""A room of 4 m with a window, a camera and a sun, on ground of any width."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View

FILE = Path(__file__).resolve().parents[1] / "scenes" / "room_on_ground.gltf"
WIDTH = 20.0
"""Width of the file's ground in metres."""


def room_on_ground(width: float) -> Scene:
    """The scene with `width` metres of ground. Its first mesh is the ground, at y = -0.11 m."""
    scene = read_scene(FILE)
    ground = scene.meshes[0]
    stretch = np.array([width / WIDTH, 1.0, width / WIDTH], np.float32)
    return replace(scene, meshes=(replace(ground, positions=ground.positions * stretch), *scene.meshes[1:]))


def room_view(scene: Scene, size: tuple[int, int]) -> View:
    """The file's camera, in the room, and its sun."""
    return View("room", "fitted", size, scene.cameras[0], scene.lights)
