"""Reflective shadow map pass (Dachsbacher and Stamminger 2005): the scene from every light face."""

import moderngl

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.gpu.gpu_program import RasterProgram
from vpltune.renderer.gpu.render_targets import ReflectiveShadowMap
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.scene_buffers import SCENE_READS, SceneBuffers
from vpltune.renderer.gpu.shader_library import set_uniforms


class ReflectiveShadowMapPass(FramePass):
    """Scene, light faces → RSM atlas (depth, geometric normal, reflectance)."""

    name = "reflective_shadow_map"

    def __init__(self, resources: Resources, scene: SceneBuffers, rsm: ReflectiveShadowMap):
        self._context = resources.context
        self._scene = scene
        self._rsm = rsm
        self._program = RasterProgram(
            resources,
            "reflective_shadow_map/reflective_shadow_map",
            reads=(*SCENE_READS, "lights", "rsm_faces"),
        )
        self._vertex_array = scene.vertex_array(self._program.program)

    def draw(self, inputs: FrameInputs) -> None:
        """Fill the atlas, a tile for each face."""
        rsm, framebuffer = self._rsm, self._rsm.framebuffer
        framebuffer.use()
        framebuffer.clear(0.0, 0.0, 0.0, 0.0, depth=0.0)
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = ">"
        self._program.bind()
        for face in range(rsm.face_count):
            column, row = face % rsm.columns, face // rsm.columns
            tile = (column * rsm.resolution, row * rsm.resolution, rsm.resolution, rsm.resolution)
            framebuffer.viewport = tile
            framebuffer.scissor = tile
            set_uniforms(self._program.program, face_index=face)
            self._scene.draw(self._program, self._vertex_array)
        framebuffer.viewport = (0, 0, *rsm.depth.size)
        framebuffer.scissor = (0, 0, *rsm.depth.size)
