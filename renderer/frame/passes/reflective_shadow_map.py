"""Reflective shadow map pass (Dachsbacher and Stamminger 2005): the scene from every light face."""

import moderngl

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.gpu.render_targets import ReflectiveShadowMap
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.gpu.scene_program import SceneProgram, scene_programs


class ReflectiveShadowMapPass(FramePass):
    """Scene, light faces → RSM atlas (depth, geometric normal, reflectance)."""

    name = "reflective_shadow_map"

    def __init__(self, resources: Resources, scene: SceneBuffers, rsm: ReflectiveShadowMap):
        self._context = resources.context
        self._rsm = rsm
        shader = "reflective_shadow_map/reflective_shadow_map"
        self._programs = scene_programs(resources, scene, shader, ("lights", "rsm_faces"))

    def draw(self, inputs: FrameInputs) -> None:
        """Fill the atlas, a tile for each face."""
        rsm, framebuffer = self._rsm, self._rsm.framebuffer
        framebuffer.use()
        framebuffer.clear(0.0, 0.0, 0.0, 0.0, depth=0.0)
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = ">"
        for program in self._programs:
            program.bind()
            self._draw_faces(program)
        framebuffer.viewport = (0, 0, *rsm.depth.size)
        framebuffer.scissor = (0, 0, *rsm.depth.size)

    def _draw_faces(self, program: SceneProgram) -> None:
        rsm, framebuffer = self._rsm, self._rsm.framebuffer
        for face in range(rsm.face_count):
            framebuffer.viewport = framebuffer.scissor = rsm.tile(face)
            program.draw(face_index=face)
