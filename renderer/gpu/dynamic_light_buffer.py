"""The dynamic lights on the GPU."""

import moderngl

from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.scene.dynamic_lights import DynamicLights


class DynamicLightBuffer:
    """The lights on the GPU: one write a frame, a new buffer only where there are more lights than ever."""

    def __init__(self, context: moderngl.Context):
        self._context = context
        self._buffer: moderngl.Buffer | None = None

    def upload(self, lights: DynamicLights) -> None:
        """Write and bind the lights of this frame."""
        size = lights.numbers.nbytes
        if self._buffer is None or self._buffer.size < size:
            self._buffer = self._context.buffer(reserve=size)
        self._buffer.write(lights.numbers)
        self._buffer.bind_to_storage_buffer(buffer_bindings.DYNAMIC_LIGHTS)
