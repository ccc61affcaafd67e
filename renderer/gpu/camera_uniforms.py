"""What shaders need to know of a camera."""

import math
from dataclasses import dataclass

import moderngl
import numpy as np
from jaxtyping import Float64

from vpltune.renderer.gpu.render_targets import GBuffer
from vpltune.renderer.gpu.shader_library import set_uniforms
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

    def bind_gbuffer(
        self, program: moderngl.Program | moderngl.ComputeShader, gbuffer: GBuffer, first_unit: int
    ) -> None:
        """Bind the G-buffer for shaders that include `common/gbuffer.glsl`."""
        gbuffer.depth.use(first_unit)
        gbuffer.normal.use(first_unit + 1)
        set_uniforms(
            program,
            gbuffer_depth=first_unit,
            gbuffer_normal=first_unit + 1,
            camera_to_world=self.camera_to_world,
            tan_half_fov=self.tan_half_fov,
            near_plane=self.near_plane,
        )


def camera_uniforms(
    camera: Camera, size: tuple[int, int], bounds: Float64[np.ndarray, "2 3"]
) -> CameraUniforms:
    """The uniforms of `camera` for `size` = (width, height) pixels and a scene within `bounds`."""
    tan_half = math.tan(camera.yfov / 2.0)
    return CameraUniforms(
        camera_to_world=camera.to_world,
        world_to_camera=camera.world_to_camera,
        tan_half_fov=(tan_half * size[0] / size[1], tan_half),
        near_plane=NEAR_PLANE * float(np.linalg.norm(bounds[1] - bounds[0])) / 2.0,
        eye_world=tuple(float(value) for value in camera.position_world),
    )
