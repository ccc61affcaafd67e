"""The artist parameters on the GPU: one small buffer that every pass of a frame reads."""

import moderngl

from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.parameter_block import BLOCK_BYTES, parameter_bytes, unpack_parameters
from vpltune.renderer.gpu import buffer_bindings


class ParameterBuffer:
    """The block of shaders/common/artist_parameters.glsl; written only when the parameters change."""

    def __init__(self, context: moderngl.Context):
        self._buffer = context.buffer(reserve=BLOCK_BYTES)
        self._written: ArtistParameters | None = None

    def write(self, parameters: ArtistParameters) -> None:
        """Make these the parameters of what is drawn next."""
        if parameters != self._written:
            self._buffer.write(parameter_bytes(parameters))
            self._written = parameters

    def bind(self) -> None:
        """Bind what the passes read."""
        self._buffer.bind_to_storage_buffer(buffer_bindings.ARTIST_PARAMETERS)

    def read(self) -> ArtistParameters:
        """What was last drawn with: waits for the GPU."""
        return unpack_parameters(self._buffer.read())
