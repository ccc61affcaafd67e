"""Scene files read whole and right, or refused in one line."""

from vpltune.renderer.scene.files.scene_reader import read_scene

__all__ = ["read_scene"]
