"""Geometry pass: the scene from the camera into the G-buffer."""

import moderngl

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.gpu.render_targets import GBuffer
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.gpu.scene_program import scene_programs


class GeometryPass(FramePass):
    """Scene, camera → G-buffer (depth, shading normal, albedo; emission where surfaces glow)."""

    name = "geometry"

    def __init__(self, resources: Resources, scene: SceneBuffers, gbuffer: GBuffer):
        self._context = resources.context
        self._gbuffer = gbuffer
        self._programs = scene_programs(
            resources,
            scene,
            "geometry/geometry",
            ("emission_texture",) if scene.glows else (),
            {"GLOWS": 1} if scene.glows else {},
        )

    def draw(self, inputs: FrameInputs) -> None:
        """Fill the G-buffer."""
        framebuffer = self._gbuffer.framebuffer
        framebuffer.use()
        framebuffer.clear(0.0, 0.0, 0.0, 0.0, depth=0.0)
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = ">"
        for program in self._programs:
            program.bind(**inputs.camera.uniforms)
            program.draw()
