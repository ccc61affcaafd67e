"""Mitsuba scenes brought to our own description, without Mitsuba."""

from vpltune.renderer.scene.mitsuba_import.mitsuba_scene import read_mitsuba as read_mitsuba
