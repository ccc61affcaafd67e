"""A frame as it was drawn, and calls that find their own OpenGL context current."""

import functools
from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

import moderngl
import numpy as np
from jaxtyping import Float32

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import MachineError
from vpltune.renderer.frame.capture import CapturedFrame, capture_frame, in_world_units
from vpltune.renderer.frame.frame import Frame
from vpltune.renderer.frame.frame_pass import FrameInputs
from vpltune.renderer.gpu.gpu_context import check_errors
from vpltune.renderer.scene.views import View


@runtime_checkable
class HasContext(Protocol):
    """What lives on an OpenGL context."""

    @property
    def context(self) -> moderngl.Context:
        """The context."""
        ...


def on_own_context(method: Callable[..., Any]) -> Callable[..., Any]:
    """Make the object's context current before a call: another runtime may have taken its place.

    It stays current. moderngl's `with context` would leave none current behind it, not the one before.
    """

    @functools.wraps(method)
    def on_own_context(self: HasContext, *arguments: object, **keywords: object) -> Any:
        self.context.__enter__()
        try:
            return method(self, *arguments, **keywords)
        except moderngl.Error as error:
            # Targets that do not fit into memory leave a framebuffer incomplete; all else is a defect.
            if "not complete" not in str(error):
                raise
            renderer = self.context.info["GL_RENDERER"]
            raise MachineError(f"OpenGL: {error} ({renderer}); a smaller --size may do") from error

    return on_own_context


class DrawnFrame:
    """A frame as it was drawn, still on the GPU; it holds until the runtime draws again."""

    def __init__(self, frame: Frame, inputs: FrameInputs, view: View, config: TunedConfig, scale: float):
        self.frame = frame
        self.inputs = inputs
        self._scale = scale
        self._view = view
        self._config = config

    @property
    def context(self) -> moderngl.Context:
        """The OpenGL context that it was drawn on."""
        return self.frame.resources.context

    @property
    def display(self) -> moderngl.Texture:
        """The 8-bit display image, row 0 at the bottom."""
        return self.frame.texture("display")

    @on_own_context
    def read_exposure(self) -> float:
        """What radiance was multiplied by for display: waits for the GPU."""
        return self.frame.read_exposure()

    @on_own_context
    def read_parameters(self) -> ArtistParameters:
        """The parameters that it was drawn with; waits for the GPU where a prior set some of them."""
        return self._config.parameters if self._config.auto is None else self.frame.read_parameters()

    @on_own_context
    def capture(self, *, maps: bool = True) -> CapturedFrame:
        """Read back the buffers that the gather reads and makes; `maps` False leaves out visibility maps."""
        discs = self._config.parameters.vpls_are_discs
        captured = capture_frame(self.frame, self._view, discs=discs, maps=maps)
        check_errors(self.context, f"the buffers of view {self._view.name}")
        return in_world_units(captured, self._scale)

    @on_own_context
    def read_statistics(self) -> Float32[np.ndarray, " statistics"]:
        """The scene statistics that `renderer.config.scene_statistics` names: waits for the GPU."""
        return self.frame.read_statistics(self.inputs)
