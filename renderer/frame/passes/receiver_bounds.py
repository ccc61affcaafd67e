"""Receiver bounds: boxes around all that the camera sees."""

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import GBUFFER_READS
from vpltune.renderer.gpu.resources import Resources

TILE = 16
"""Pixels along the side of a tile, whose receivers are grouped. A choice: 8 left out 4 % more rays in five
scenes, for more than twice the boxes."""
DISTANCE_STEPS = 5.0
"""Groups for each factor e in distance: one spans 22 %. A choice."""
BOXES_OF_TILE = 16
"""Boxes that there is room for, for each tile in the mean. A choice: rooms have 3."""
_BOX_BYTES = 64
"""Bytes of `ReceiverBounds` in shaders/common/receiver_bounds.glsl."""
_HEAD_BYTES = 16
"""Bytes before the first box there."""


class ReceiverBoundsPass(FramePass):
    """G-buffer → `receiver_bounds`, boxes that together hold every receiver, with bounds of their normals.

    The list counts boxes that it has no room for too: then its readers must do without it.
    """

    name = "receiver_bounds"

    def __init__(self, resources: Resources):
        self._resources = resources
        depth = resources.texture("gbuffer_depth")
        self._groups = (-(-depth.width // TILE), -(-depth.height // TILE))
        room = BOXES_OF_TILE * self._groups[0] * self._groups[1]
        resources["receiver_bounds"] = resources.context.buffer(reserve=_HEAD_BYTES + room * _BOX_BYTES)
        self._program = ComputeProgram(
            resources,
            "receiver_bounds/receiver_bounds",
            {"RECEIVER_TILE": TILE, "RECEIVER_DISTANCE_STEPS": DISTANCE_STEPS},
            reads=GBUFFER_READS,
            writes=("receiver_bounds",),
        )

    def draw(self, inputs: FrameInputs) -> None:
        """List the boxes."""
        self._resources.write("receiver_bounds", bytes(_HEAD_BYTES))
        self._program.dispatch(*self._groups, **inputs.camera.uniforms)
