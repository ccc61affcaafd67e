"""Import of Mitsuba XML scenes. Mitsuba itself is not needed."""

from vpltune.renderer.scene.mitsuba_import.mitsuba_scene import read_mitsuba as read_mitsuba
