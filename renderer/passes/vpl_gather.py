"""VPL gather: indirect irradiance at every pixel from every VPL, in a compute shader."""

import moderngl

from renderer import buffer_bindings
from renderer.artist_parameters import ArtistParameters
from renderer.camera_uniforms import CameraUniforms
from renderer.render_targets import GBuffer
from renderer.shader_library import load_compute, set_uniforms


class VplGatherPass:
    """G-buffer, VPLs → indirect irradiance."""

    def __init__(self, context: moderngl.Context):
        self._context = context
        self._program = load_compute(context, "vpl_gather", buffer_bindings.DEFINES)

    def draw(
        self,
        camera: CameraUniforms,
        gbuffer: GBuffer,
        vpl_count: int,
        parameters: ArtistParameters,
        indirect_irradiance: moderngl.Texture,
    ) -> None:
        """Gather from the VPLs that are bound."""
        camera.bind_gbuffer(self._program, gbuffer, 0)
        set_uniforms(
            self._program,
            vpl_count=vpl_count,
            intensity=parameters.intensity,
            falloff_footprint=parameters.falloff_footprint,
            falloff_transmittance=parameters.falloff_transmittance,
        )
        indirect_irradiance.bind_to_image(0, read=False, write=True)
        self._program.run(-(-indirect_irradiance.width // 8), -(-indirect_irradiance.height // 8))
        self._context.memory_barrier(self._context.TEXTURE_FETCH_BARRIER_BIT)
