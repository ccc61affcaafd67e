"""Readers for scene files: glTF, OBJ and PLY. Unsupported input is rejected with one line."""

from vpltune.renderer.scene.files.scene_reader import read_scene

__all__ = ["read_scene"]
