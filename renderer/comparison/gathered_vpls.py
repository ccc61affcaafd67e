"""The frame's own gather over VPLs that came by another way than the frame's."""

import moderngl
import numpy as np

from renderer import buffer_bindings
from renderer.artist_parameters import ArtistParameters
from renderer.frame import Frame
from renderer.parameter_buffer import ParameterBuffer
from renderer.passes.virtual_point_lights import VPL_BYTES
from renderer.passes.vpl_gather import VplGatherPass
from renderer.render_targets import create_irradiance_target
from renderer.views import View

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
    """A buffer of VPLs, and the irradiance that they give a drawn frame."""

    def __init__(self, context: moderngl.Context, frame: Frame, count: int):
        self._frame = frame
        self.count = count
        self.buffer = context.buffer(reserve=max(1, count) * VPL_BYTES)
        self.irradiance = create_irradiance_target(context, frame.size)
        self._parameters = ParameterBuffer(context)
        self._gather = VplGatherPass(context)

    def upload(self, vpls: np.ndarray) -> None:
        """Fill the buffer with `count` records of `VPL_DTYPE`."""
        self.buffer.write(np.ascontiguousarray(vpls).tobytes())

    def draw(self, view: View, parameters: ArtistParameters) -> moderngl.Texture:
        """Gather from the whole buffer, with the scene length that the frame has measured."""
        frame = self._frame
        frame.virtual_point_lights.bind()
        self.buffer.bind_to_storage_buffer(buffer_bindings.VIRTUAL_POINT_LIGHTS)
        self._parameters.write(parameters)
        self._parameters.bind()
        self._gather.draw(frame.camera(view), frame.gbuffer, self.count, self.irradiance)
        return self.irradiance
