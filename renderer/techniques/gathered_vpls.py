"""The frame's own gather over VPLs that came by another way than the frame's."""

from dataclasses import replace

import numpy as np

from vpltune.renderer.config.parameter_block import BLOCK_BYTES, parameter_bytes
from vpltune.renderer.frame.frame import Frame
from vpltune.renderer.frame.frame_pass import FrameInputs
from vpltune.renderer.frame.passes.virtual_point_lights import VPL_BYTES
from vpltune.renderer.frame.passes.vpl_gather import VplGatherPass
from vpltune.renderer.frame.visibility_map_layout import NO_MAPS
from vpltune.renderer.frame.vpl_pools import VplPools
from vpltune.renderer.gpu.render_targets import create_irradiance_target
from vpltune.renderer.gpu.resources import Resources

VPL_DTYPE = np.dtype(
    [
        ("position", "f4", 3),
        ("footprint", "f4"),
        ("normal", "f4", 3),
        ("area", "f4"),
        ("flux", "f4", 3),
        ("padding", "f4"),
    ]
)
"""A VPL as shaders/common/virtual_point_lights.glsl has it; lengths in world units, flux in W."""


class GatheredVpls:
    """A buffer of VPLs, and the irradiance that they give a drawn frame.

    `resources` are the frame's, with these VPLs in the place of its own.
    """

    def __init__(self, frame: Frame, count: int):
        self.count = count
        self.resources = resources = frame.resources.child()
        context = resources.context
        resources["virtual_point_lights"] = context.buffer(reserve=max(1, count) * VPL_BYTES)
        resources["vpl_irradiance"] = create_irradiance_target(context, frame.setup.size)
        resources["artist_parameters"] = context.buffer(reserve=BLOCK_BYTES)
        self._gather = VplGatherPass(resources, 1, NO_MAPS, VplPools(count))

    def upload(self, vpls: np.ndarray) -> None:
        """Fill the buffer with `count` records of `VPL_DTYPE`."""
        self.resources.write("virtual_point_lights", np.ascontiguousarray(vpls).tobytes())

    def draw(self, inputs: FrameInputs) -> Resources:
        """Gather from the whole buffer, as points, with the scene length that the frame has measured.

        Returns the resources, whose `vpl_irradiance` is the result.
        """
        parameters = replace(inputs.parameters, vpl_count=self.count, lloyd_iterations=0)
        self.resources.write("artist_parameters", parameter_bytes(parameters))
        self._gather.draw(replace(inputs, parameters=parameters))
        return self.resources
