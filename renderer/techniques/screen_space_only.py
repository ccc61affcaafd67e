"""Indirect light from the screen alone: every pixel, or the middle of every block, is a VPL.

No RSM is needed, and what the camera does not see gives no light (Ritschel, Grosch and Seidel 2009).
"""

from vpltune.renderer.frame.frame import Frame
from vpltune.renderer.frame.frame_pass import FrameInputs
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import GBUFFER_READS
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.techniques.gathered_vpls import GatheredVpls


class ScreenSpaceOnly:
    """G-buffer and direct irradiance of a drawn frame → irradiance."""

    def __init__(self, frame: Frame, stride: int = 1):
        self._stride = stride
        width, height = frame.setup.size
        self._blocks = (-(-width // stride), -(-height // stride))
        self._vpls = GatheredVpls(frame, self._blocks[0] * self._blocks[1])
        self._program = ComputeProgram(
            self._vpls.resources,
            "techniques/screen_space_only",
            reads=(*GBUFFER_READS, "gbuffer_albedo", "direct_irradiance"),
            writes=("virtual_point_lights",),
        )

    def draw(self, inputs: FrameInputs) -> Resources:
        """The irradiance of what the frame has just drawn; see `GatheredVpls.draw`."""
        self._program.dispatch(
            -(-self._blocks[0] // 8),
            -(-self._blocks[1] // 8),
            **inputs.camera.uniforms,
            stride=self._stride,
            blocks=self._blocks,
        )
        return self._vpls.draw(inputs)
