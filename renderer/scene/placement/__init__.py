"""Automatic cameras, lights and views, and the sidecar file in which a user sets camera, lights and sky."""

from vpltune.renderer.scene.placement.automatic_camera import default_camera
from vpltune.renderer.scene.placement.automatic_light import default_light
from vpltune.renderer.scene.placement.named_camera import named_camera, named_cameras
from vpltune.renderer.scene.placement.scene_sidecar import resolve_camera_and_lights
from vpltune.renderer.scene.placement.scene_sky import with_environment
from vpltune.renderer.scene.placement.view_set import views_for_scene

__all__ = [
    "default_camera",
    "default_light",
    "named_camera",
    "named_cameras",
    "resolve_camera_and_lights",
    "views_for_scene",
    "with_environment",
]
