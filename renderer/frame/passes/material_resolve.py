"""Material resolve: irradiance and albedo to radiance towards the eye."""

import moderngl

from vpltune.renderer.gpu.render_targets import GBuffer
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms


class MaterialResolvePass:
    """G-buffer albedo, direct and indirect irradiance → radiance."""

    def __init__(self, context: moderngl.Context):
        self._context = context
        self._program = load_compute(context, "display/material_resolve")

    def draw(
        self,
        gbuffer: GBuffer,
        direct_irradiance: moderngl.Texture,
        indirect_irradiance: moderngl.Texture,
        share: tuple[float, float],
        radiance: moderngl.Texture,
    ) -> None:
        """`share` weighs direct and indirect light: (1, 1) is the full image."""
        for unit, texture in enumerate((gbuffer.albedo, direct_irradiance, indirect_irradiance)):
            texture.use(unit)
        set_uniforms(self._program, gbuffer_albedo=0, direct_irradiance=1, indirect_irradiance=2, share=share)
        radiance.bind_to_image(0, read=False, write=True)
        self._program.run(-(-radiance.width // 8), -(-radiance.height // 8))
        self._context.memory_barrier(self._context.TEXTURE_FETCH_BARRIER_BIT)
