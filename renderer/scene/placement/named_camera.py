"""Cameras of a scene file by name or number."""

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.scene import Camera, Scene

ALL = "all"
"""Stands for every camera of the file."""
SHOWN_NAMES = 20
"""Names in a message at most. A choice: a line that can still be read."""


def named_cameras(scene: Scene, name: str) -> tuple[Camera, ...]:
    """The camera of this name, or of this number, from 1; with `all`, every camera of the file.

    Raises:
        InputError: the scene has no such camera.
    """
    cameras = scene.cameras
    if name == ALL and cameras:
        return cameras
    found = [camera for camera in cameras if camera.name == name]
    if found:
        return (found[0],)
    if name.isascii() and name.isdecimal() and 1 <= int(name[:9]) <= len(cameras):
        return (cameras[int(name) - 1],)
    if not cameras:
        raise InputError(f"--camera: the scene has no cameras, got {name!r:.60}")
    known = [f"{camera.name or number!r}" for number, camera in enumerate(cameras, 1)][:SHOWN_NAMES]
    more = f" and {len(cameras) - SHOWN_NAMES} more" if len(cameras) > SHOWN_NAMES else ""
    raise InputError(f"--camera: must be {ALL} or one of {', '.join(known)}{more}, got {name!r:.60}")


def named_camera(scene: Scene, name: str) -> Camera:
    """The one camera of this name or number.

    Raises:
        InputError: the scene has no such camera, or `name` stands for several.
    """
    if name == ALL and len(scene.cameras) > 1:
        raise InputError(f"--camera: {ALL} is for fit and evaluate; an image needs one camera")
    return named_cameras(scene, name)[0]
