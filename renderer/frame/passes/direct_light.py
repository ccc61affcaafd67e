"""Direct light: the light pre-pass's sum, and the punctual lights with shadows from their RSMs."""

import moderngl

from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.camera_uniforms import CameraUniforms
from vpltune.renderer.gpu.render_targets import GBuffer, LightAccumulation, ReflectiveShadowMap
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms


class DirectLightPass:
    """G-buffer, RSM, light accumulation → direct irradiance."""

    def __init__(self, context: moderngl.Context, rsm_resolution: int):
        self._context = context
        defines = {**buffer_bindings.DEFINES, "RSM_RESOLUTION": rsm_resolution}
        self._program = load_compute(context, "direct_light/direct_light", defines)

    def draw(
        self,
        camera: CameraUniforms,
        gbuffer: GBuffer,
        rsm: ReflectiveShadowMap,
        light_count: int,
        accumulated: LightAccumulation | None,
        direct_irradiance: moderngl.Texture,
    ) -> None:
        camera.bind_gbuffer(self._program, gbuffer, 0)
        rsm.bind(self._program, 2)
        set_uniforms(self._program, light_count=light_count, light_accumulation=5)
        if accumulated is None:
            set_uniforms(self._program, accumulation_unit=0.0)
        else:
            accumulated.texture.use(5)
            set_uniforms(self._program, accumulation_unit=accumulated.unit)
        direct_irradiance.bind_to_image(0, read=False, write=True)
        self._program.run(-(-direct_irradiance.width // 8), -(-direct_irradiance.height // 8))
        self._context.memory_barrier(self._context.TEXTURE_FETCH_BARRIER_BIT)
