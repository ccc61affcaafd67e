"""Geometry pass: the scene from the camera into the G-buffer."""

import moderngl

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.gpu.gpu_program import RasterProgram
from vpltune.renderer.gpu.render_targets import GBuffer
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.scene_buffers import SCENE_READS, SceneBuffers


class GeometryPass(FramePass):
    """Scene, camera → G-buffer (depth, shading normal, albedo)."""

    name = "geometry"

    def __init__(self, resources: Resources, scene: SceneBuffers, gbuffer: GBuffer):
        self._context = resources.context
        self._scene = scene
        self._gbuffer = gbuffer
        self._program = RasterProgram(resources, "geometry/geometry", reads=SCENE_READS)
        self._vertex_array = scene.vertex_array(self._program.program)

    def draw(self, inputs: FrameInputs) -> None:
        """Fill the G-buffer."""
        framebuffer = self._gbuffer.framebuffer
        framebuffer.use()
        framebuffer.clear(0.0, 0.0, 0.0, 0.0, depth=0.0)
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = ">"
        self._program.bind(**inputs.camera.uniforms)
        self._scene.draw(self._program, self._vertex_array)
