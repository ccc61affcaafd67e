"""Import of Mitsuba XML scenes. Mitsuba itself is needed for computed skies alone."""

from vpltune.renderer.scene.mitsuba_import.mitsuba_scene import read_mitsuba as read_mitsuba
