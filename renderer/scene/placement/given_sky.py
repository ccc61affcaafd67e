"""The sky as a sidecar or a flag gives it: an even radiance, or the file of an environment map."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.environment import Environment, even_sky
from vpltune.renderer.scene.environment_baking import baked_environment
from vpltune.renderer.scene.files.diagnostics import SceneFileError, one_line
from vpltune.renderer.scene.files.environment_file import environment_planes
from vpltune.renderer.scene.files.scene_folder import SceneFolder


@dataclass(frozen=True)
class GivenSky:
    """Either `radiance` or `file`."""

    radiance: tuple[float, float, float] | None = None
    """The same in all directions, RGB in W/(m² sr), each in [0, 1e18]."""
    file: str | None = None
    """An equirectangular map, .exr or .hdr."""
    scale: float = 1.0
    """A factor of the map's radiance, ≥ 0."""
    rotation_degrees: float = 0.0
    """Turns the map about +Y, counter-clockwise seen from above."""

    def environment(self, scene_path: Path | None, where: str) -> Environment | None:
        """The environment; None if it is black.

        Args:
            scene_path: the scene's file, in whose folder or below the map must be; None if the map may be
                anywhere, since the user named it.
            where: what gives the sky, for messages.

        Raises:
            InputError: the file cannot be read, or is no map that can be drawn.
        """
        if self.radiance is not None:
            return even_sky(self.radiance) if any(self.radiance) else None
        assert self.file is not None, "a sky has a radiance or a file"
        try:
            if scene_path is None:
                content = SceneFolder(Path(self.file)).read_scene_file(Path(self.file))
            else:
                content = SceneFolder(scene_path).read(self.file, where)
            with np.errstate(all="ignore"):
                planes = environment_planes(content, self.file, self.scale, f"{where}: {self.file!r:.80}")
        except SceneFileError as error:
            named = scene_path is not None or str(error).startswith(where)
            said = error if named else f"{where}: {self.file!r:.80}: {error}"
            raise InputError(one_line(str(said), 4096)) from error
        if not any(plane.any() for plane in planes):
            return None
        angle = math.radians(self.rotation_degrees)
        sine, cosine = math.sin(angle), math.cos(angle)
        turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
        return baked_environment(planes, turn)
