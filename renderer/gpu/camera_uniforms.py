"""What shaders need to know of a camera."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.light_faces import NEAR_PLANE
from vpltune.renderer.scene.scene import Camera


@dataclass(frozen=True, eq=False)
class CameraUniforms:
    """A camera for one image size; lengths in world units."""

    camera_to_world: np.ndarray
    world_to_camera: np.ndarray
    tan_half_fov: tuple[float, float]
    near_plane: float
    eye_world: tuple[float, float, float]

    @property
    def uniforms(self) -> dict[str, object]:
        """What shaders call them; a shader that lacks one passes over it."""
        return {
            "camera_to_world": self.camera_to_world,
            "world_to_camera": self.world_to_camera,
            "tan_half_fov": self.tan_half_fov,
            "near_plane": self.near_plane,
            "eye_world": self.eye_world,
        }


def camera_uniforms(
    camera: Camera, size: tuple[int, int], bounds: Float64[np.ndarray, "2 3"]
) -> CameraUniforms:
    """The uniforms of `camera` for `size` = (width, height) pixels and a scene within `bounds`."""
    tan_half = math.tan(camera.yfov / 2.0)
    x, y, z = camera.position_world
    return CameraUniforms(
        camera_to_world=camera.to_world,
        world_to_camera=camera.world_to_camera,
        tan_half_fov=(tan_half * size[0] / size[1], tan_half),
        near_plane=NEAR_PLANE * float(np.linalg.norm(bounds[1] - bounds[0])) / 2.0,
        eye_world=(float(x), float(y), float(z)),
    )
