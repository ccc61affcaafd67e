"""Indirect light from the screen alone: every pixel, or the middle of every block, is a VPL.

No RSM is needed, and what the camera does not see gives no light (Ritschel, Grosch and Seidel 2009).
"""

import moderngl

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.frame.frame import Frame
from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms
from vpltune.renderer.scene.views import View
from vpltune.renderer.techniques.gathered_vpls import GatheredVpls


class ScreenSpaceOnly:
    """G-buffer and direct irradiance of a drawn frame → irradiance."""

    def __init__(self, context: moderngl.Context, frame: Frame, stride: int = 1):
        self._context = context
        self._frame = frame
        self._stride = stride
        self._blocks = (-(-frame.size[0] // stride), -(-frame.size[1] // stride))
        self._vpls = GatheredVpls(context, frame, self._blocks[0] * self._blocks[1])
        self._program = load_compute(context, "techniques/screen_space_only", buffer_bindings.DEFINES)

    def draw(self, view: View, parameters: ArtistParameters) -> moderngl.Texture:
        """The irradiance image of a view that the frame has just drawn."""
        frame = self._frame
        self._vpls.buffer.bind_to_storage_buffer(buffer_bindings.VIRTUAL_POINT_LIGHTS)
        frame.camera(view).bind_gbuffer(self._program, frame.gbuffer, 0)
        frame.gbuffer.albedo.use(2)
        frame.direct_irradiance.use(3)
        set_uniforms(
            self._program, gbuffer_albedo=2, direct_irradiance=3, stride=self._stride, blocks=self._blocks
        )
        self._program.run(-(-self._blocks[0] // 8), -(-self._blocks[1] // 8))
        self._context.memory_barrier(self._context.SHADER_STORAGE_BARRIER_BIT)
        return self._vpls.draw(view, parameters)
