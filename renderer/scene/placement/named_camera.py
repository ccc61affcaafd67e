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
    if name == ALL and scene.cameras:
        return scene.cameras
    return (_one(scene, name, f"{ALL} or one of"),)


def named_camera(scene: Scene, name: str) -> Camera:
    """The one camera of this name or number.

    Raises:
        InputError: the scene has no such camera, or `name` stands for several.
    """
    if name == ALL and len(scene.cameras) > 1:
        raise InputError(f"--camera: an image needs one camera, got {ALL}, which is for fit and evaluate")
    return scene.cameras[0] if name == ALL and scene.cameras else _one(scene, name, "one of")


def _one(scene: Scene, name: str, allowed: str) -> Camera:
    cameras = scene.cameras
    for camera in cameras:
        if camera.name == name:
            return camera
    digits = name.lstrip("0") if name.isascii() and name.isdecimal() else ""
    # Python refuses to read numbers of thousands of digits.
    if 0 < len(digits) < 10 and int(digits) <= len(cameras):
        return cameras[int(digits) - 1]
    if not cameras:
        raise InputError(f"--camera: the scene has no cameras; leave --camera out, got {name!r:.60}")
    known = [f"{camera.name or number!r}" for number, camera in enumerate(cameras, 1)][:SHOWN_NAMES]
    more = f" and {len(cameras) - SHOWN_NAMES} more" if len(cameras) > SHOWN_NAMES else ""
    raise InputError(f"--camera: must be {allowed} {', '.join(known)}{more}, got {name!r:.60}")
