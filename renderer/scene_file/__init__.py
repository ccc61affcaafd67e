"""Scene files read whole and right, or refused in one line."""

from renderer.scene_file.scene_reader import read_scene

__all__ = ["read_scene"]
