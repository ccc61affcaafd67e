"""The view that a command draws: one of a views.json, or one from flags, from the scene, or placed for it."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from vpltune.cli.options import parse_size
from vpltune.cli.report import warn
from vpltune.cli.view_flags import camera_from_flags, light_from_flags, sky_from_flags
from vpltune.cli.view_options import ViewFlags
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import named_camera, resolve_camera_and_lights, with_environment
from vpltune.renderer.scene.placement.given_sky import GivenSky
from vpltune.renderer.scene.scene import Camera, Light
from vpltune.renderer.scene.views import View, read_views
from vpltune.renderer.scene.working_scale import require_drawable

if TYPE_CHECKING:
    from vpltune.renderer.scene.scene import Scene

DEFAULT_SIZE = (960, 540)
"""Width and height of an image, in pixels. A choice."""


@dataclass(frozen=True)
class ChosenView:
    """What the command line says about the view, before the scene is read."""

    from_file: View | None
    """A view of `--views`; None without that flag."""
    camera: Camera | None
    """None if no camera was given."""
    camera_name: str | None
    """The name or number of a camera of the file; None if none was given."""
    light: Light | None
    """None if no light was given."""
    size: tuple[int, int]
    """Width and height of the image, in pixels."""
    sky: GivenSky | None = None
    """None if no sky was given."""

    def read(self, scene_path: Path) -> "Scene":
        """The scene of a file, in the sky that was given or that its sidecar has; with the file's warnings.

        Raises:
            InputError: a file cannot be used.
        """
        scene = read_scene(scene_path)
        warn(scene.warnings)
        return with_environment(scene, scene_path, self.sky)

    def placed(self, scene: "Scene", scene_path: Path) -> View:
        """The view of a scene, with warnings about what was chosen.

        A camera or light that was not given comes from the scene's sidecar or from the scene, or is placed
        automatically.

        Raises:
            InputError: the sidecar cannot be used, or a light is too strong for the scene.
        """
        if self.from_file is not None:
            require_drawable(self.from_file.lights, scene, f"view {self.from_file.name!r:.60}")
            return replace(self.from_file, size=self.size)
        given = None if self.light is None else (self.light,)
        own = self.camera if self.camera_name is None else named_camera(scene, self.camera_name)
        camera, lights, notes = resolve_camera_and_lights(scene, scene_path, own, given)
        warn(notes)
        return View("main", "fitted", self.size, camera, lights)


def chosen_view(views: Path | None, name: str | None, size: str | None, flags: ViewFlags) -> ChosenView:
    """Check `--views`, `--view`, `--size` and the flags of camera and light.

    Raises:
        InputError: flags exclude each other, the views file has no such view, or a value is out of range.
    """
    from_file = _view_from_file(views, name, flags)
    unasked = DEFAULT_SIZE if from_file is None else from_file.size
    pixels = unasked if size is None else parse_size(size)
    return ChosenView(
        from_file,
        camera_from_flags(flags),
        flags.camera,
        light_from_flags(flags),
        pixels,
        sky_from_flags(flags.sky, flags.environment),
    )


def _view_from_file(path: Path | None, name: str | None, flags: ViewFlags) -> View | None:
    if path is None:
        if name is not None:
            raise InputError("--view: names a view of --views FILE, which is missing")
        return None
    if flags.place_a_view:
        raise InputError("--views: has its own camera and lights; leave out the camera and light flags")
    found = read_views(path)
    names = [view.name for view in found]
    if name is None and len(found) > 1:
        raise InputError(f"--view: must be given: {path} has {', '.join(names)}")
    if name is not None and name not in names:
        raise InputError(f"--view: {path} has {', '.join(names)}, got {name!r:.60}")
    return next(view for view in found if name in (None, view.name))
