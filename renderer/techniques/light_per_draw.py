"""One full-screen draw for each dynamic light: what the light pre-pass replaces, kept to compare with."""

import moderngl

from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.camera_uniforms import CameraUniforms
from vpltune.renderer.gpu.render_targets import GBuffer, create_irradiance_target
from vpltune.renderer.gpu.shader_library import load_program, set_uniforms
from vpltune.renderer.scene.dynamic_lights import MIN_DISTANCE, DynamicLights


class LightPerDrawPass:
    """G-buffer, lights → light accumulation, in as many draws as there are lights."""

    def __init__(self, context: moderngl.Context, gbuffer: GBuffer):
        self._context = context
        self._gbuffer = gbuffer
        self.light_accumulation = create_irradiance_target(context, gbuffer.depth.size)
        defines = {**buffer_bindings.DEFINES, "MIN_DISTANCE": MIN_DISTANCE}
        self._program = load_program(context, "techniques/light_per_draw", defines)
        self._triangle = context.vertex_array(self._program, [])
        self._framebuffer = context.framebuffer([self.light_accumulation])

    def draw(self, camera: CameraUniforms, lights: DynamicLights) -> None:
        """Accumulate the lights that are bound."""
        self._framebuffer.use()
        self._framebuffer.clear(0.0, 0.0, 0.0, 0.0)
        self._context.enable_only(moderngl.BLEND)
        self._context.blend_func = moderngl.ONE, moderngl.ONE
        camera.bind_gbuffer(self._program, self._gbuffer, 0)
        set_uniforms(self._program, accumulation_unit=lights.accumulation_unit)
        for light in range(len(lights)):
            self._program["light_index"] = light
            self._triangle.render(moderngl.TRIANGLES, vertices=3)
