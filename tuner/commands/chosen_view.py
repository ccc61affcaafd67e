"""Which view a command draws: one of a views.json, or one placed from flags, the scene or by choice."""

from pathlib import Path
from typing import TYPE_CHECKING

from renderer.errors import InputError
from tuner.commands.report import warn
from tuner.commands.view_flags import ViewFlags

if TYPE_CHECKING:
    from renderer.scene import Camera, Light, Scene
    from renderer.views import View

DEFAULT_SIZE = (960, 540)


def view_from_file(path: Path | None, name: str | None, flags: ViewFlags) -> "View | None":
    """The view of `--views` and `--view`; None where no file is given.

    Raises:
        InputError: there is no such view, more than one to choose from, or flags that go with none.
    """
    from renderer.views import read_views

    if path is None:
        if name is not None:
            raise InputError("--view: names a view of --views FILE, which is missing")
        return None
    if flags != ViewFlags():
        raise InputError("--views: has its own camera and lights; leave out the camera and light flags")
    found = read_views(path)
    names = [view.name for view in found]
    if name is None and len(found) > 1:
        raise InputError(f"--view: must be given, {path} has {', '.join(names)}")
    if name is not None and name not in names:
        raise InputError(f"--view: {path} has {', '.join(names)}, got {name!r:.60}")
    return found[0] if name is None else found[names.index(name)]


def placed_view(
    scene: "Scene", scene_path: Path, camera_given: "Camera | None", light_given: "Light | None"
) -> "View":
    """Camera and lights from flags, a file beside the scene or the scene; or chosen, and then said."""
    from renderer.view_placement import resolve_camera_and_lights
    from renderer.views import View

    camera, lights, notes = resolve_camera_and_lights(
        scene, scene_path, camera_given, None if light_given is None else (light_given,)
    )
    warn(notes)
    return View("main", "fitted", DEFAULT_SIZE, camera, lights)
