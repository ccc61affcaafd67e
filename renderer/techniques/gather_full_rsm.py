"""Gather from the whole RSM: every texel, or the middle of every block of texels, is a VPL.

What Dachsbacher and Stamminger (2005) sample at random, in full: it has no sampling error, and its cost
grows with the map.
"""

import moderngl

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.frame.frame import Frame
from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms
from vpltune.renderer.scene.views import View
from vpltune.renderer.techniques.gathered_vpls import GatheredVpls


class GatherFullRsm:
    """RSM of a drawn frame → irradiance. `stride` texels along each side are taken together."""

    def __init__(self, context: moderngl.Context, frame: Frame, stride: int = 1):
        self._context = context
        self._frame = frame
        self._stride = stride
        columns, rows = frame.rsm.depth.size
        self._blocks = (-(-columns // stride), -(-rows // stride))
        self._vpls = GatheredVpls(context, frame, self._blocks[0] * self._blocks[1])
        defines = {**buffer_bindings.DEFINES, "RSM_RESOLUTION": frame.rsm.resolution}
        self._program = load_compute(context, "techniques/gather_full_rsm", defines)

    def draw(self, view: View, parameters: ArtistParameters) -> moderngl.Texture:
        """The irradiance image of a view that the frame has just drawn."""
        self._vpls.buffer.bind_to_storage_buffer(buffer_bindings.VIRTUAL_POINT_LIGHTS)
        self._frame.rsm.bind(self._program, 0)
        set_uniforms(self._program, stride=self._stride, blocks=self._blocks)
        self._program.run(-(-self._blocks[0] // 8), -(-self._blocks[1] // 8))
        self._context.memory_barrier(self._context.SHADER_STORAGE_BARRIER_BIT)
        return self._vpls.draw(view, parameters)
