"""Reflective shadow map pass (Dachsbacher and Stamminger 2005): the scene from every light face."""

import moderngl

from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.render_targets import ReflectiveShadowMap
from vpltune.renderer.gpu.scene_buffers import SceneBuffers
from vpltune.renderer.gpu.shader_library import load_program, set_uniforms


class ReflectiveShadowMapPass:
    """Scene, light faces → RSM atlas (depth, geometric normal, reflectance)."""

    def __init__(self, context: moderngl.Context, scene: SceneBuffers):
        self._context = context
        self._scene = scene
        self._program = load_program(
            context, "reflective_shadow_map/reflective_shadow_map", buffer_bindings.DEFINES
        )
        self._vertex_array = scene.vertex_array(self._program)

    def draw(self, rsm: ReflectiveShadowMap) -> None:
        """Fill the atlas for the lights and faces that are bound."""
        rsm.framebuffer.use()
        rsm.framebuffer.clear(0.0, 0.0, 0.0, 0.0, depth=0.0)
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._context.depth_func = ">"
        set_uniforms(self._program, base_color_texture=0)
        for face in range(rsm.face_count):
            column, row = face % rsm.columns, face // rsm.columns
            tile = (column * rsm.resolution, row * rsm.resolution, rsm.resolution, rsm.resolution)
            rsm.framebuffer.viewport = tile
            rsm.framebuffer.scissor = tile
            set_uniforms(self._program, face_index=face)
            self._scene.draw(self._vertex_array)
        rsm.framebuffer.viewport = (0, 0, *rsm.depth.size)
        rsm.framebuffer.scissor = None
