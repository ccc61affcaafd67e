"""Gather from the whole RSM: every texel, or the middle of every block of texels, is a VPL.

What Dachsbacher and Stamminger (2005) sample at random, in full: it has no sampling error, and its cost
grows with the map.
"""

from vpltune.renderer.frame.frame import Frame
from vpltune.renderer.frame.frame_pass import FrameInputs
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import RSM_READS
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.techniques.gathered_vpls import GatheredVpls


class GatherFullRsm:
    """RSM of a drawn frame → irradiance. `stride` texels along each side are taken together."""

    def __init__(self, frame: Frame, stride: int = 1):
        self._rsm = frame.rsm
        self._stride = stride
        columns, rows = frame.rsm.depth.size
        self._blocks = (-(-columns // stride), -(-rows // stride))
        self._vpls = GatheredVpls(frame, self._blocks[0] * self._blocks[1])
        self._program = ComputeProgram(
            self._vpls.resources,
            "techniques/gather_full_rsm",
            {"RSM_RESOLUTION": frame.rsm.resolution},
            reads=RSM_READS,
            writes=("virtual_point_lights",),
        )

    def draw(self, inputs: FrameInputs) -> Resources:
        """The irradiance of what the frame has just drawn; see `GatheredVpls.draw`."""
        self._program.dispatch(
            -(-self._blocks[0] // 8),
            -(-self._blocks[1] // 8),
            **self._rsm.uniforms,
            stride=self._stride,
            blocks=self._blocks,
        )
        return self._vpls.draw(inputs)
