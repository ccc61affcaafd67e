"""Two rooms of 10 m × 15 m with a partition of any thickness between them, a camera and a lamp in each."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.scene import Scene

FILE = Path(__file__).resolve().parents[1] / "scenes" / "partition.gltf"
THICKNESS = 0.30
"""Thickness of the file's partition in metres."""


def partitioned_rooms(thickness: float) -> Scene:
    """The scene with a partition of `thickness` metres, about x = 0.

    Its first lamp is in the room beyond the partition, its second in the camera's own.
    """
    scene = read_scene(FILE)
    rooms, partition = scene.meshes
    stretch = np.array([thickness / THICKNESS, 1.0, 1.0], np.float32)
    return replace(scene, meshes=(rooms, replace(partition, positions=partition.positions * stretch)))
