"""Geometry pass: the scene from the camera into the G-buffer."""

import moderngl

from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.camera_uniforms import CameraUniforms
from vpltune.renderer.gpu.render_targets import GBuffer
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.gpu.shader_library import load_program, set_uniforms


class GeometryPass:
    """Scene, camera → G-buffer (depth, shading normal, albedo)."""

    def __init__(self, context: moderngl.Context, scene: SceneBuffers):
        self._context = context
        self._scene = scene
        self._program = load_program(context, "geometry/geometry", buffer_bindings.DEFINES)
        self._vertex_array = scene.vertex_array(self._program)

    def draw(self, camera: CameraUniforms, gbuffer: GBuffer) -> None:
        gbuffer.framebuffer.use()
        gbuffer.framebuffer.clear(0.0, 0.0, 0.0, 0.0, depth=0.0)
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = ">"
        set_uniforms(
            self._program,
            world_to_camera=camera.world_to_camera,
            tan_half_fov=camera.tan_half_fov,
            near_plane=camera.near_plane,
            eye_world=camera.eye_world,
            base_color_texture=0,
        )
        self._scene.draw(self._vertex_array)
