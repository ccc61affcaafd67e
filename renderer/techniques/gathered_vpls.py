"""The frame's own gather over VPLs that came by another way than the frame's."""

import moderngl
import numpy as np

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.frame.frame import Frame
from vpltune.renderer.frame.passes.virtual_point_lights import VPL_BYTES
from vpltune.renderer.frame.passes.vpl_gather import VplGatherPass
from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.parameter_buffer import ParameterBuffer
from vpltune.renderer.gpu.render_targets import create_irradiance_target
from vpltune.renderer.scene.views import View

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
