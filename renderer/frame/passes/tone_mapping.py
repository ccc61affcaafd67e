"""Tone mapping: exposure, measured on the GPU or given, then tone curve and sRGB."""

import moderngl
import numpy as np

from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms

EXPOSURE_KEY = 0.25
"""What the mean luminance of the image is brought to before the tone curve."""


class ToneMappingPass:
    """Radiance → 8-bit display image."""

    def __init__(self, context: moderngl.Context):
        self._context = context
        defines = {**buffer_bindings.DEFINES, "EXPOSURE_KEY": EXPOSURE_KEY}
        self._measure = load_compute(context, "display/exposure", defines)
        self._program = load_compute(context, "display/tone_mapping", defines)
        self._exposure = context.buffer(reserve=16)

    def draw(self, radiance: moderngl.Texture, exposure: float | None, display: moderngl.Texture) -> None:
        """`exposure` multiplies radiance before the curve; None measures it from the image."""
        context = self._context
        self._exposure.bind_to_storage_buffer(buffer_bindings.EXPOSURE)
        radiance.use(0)
        if exposure is None:
            set_uniforms(self._measure, radiance=0)
            self._measure.run(1)
            # The exposure may be read back, or given by the program next time.
            context.memory_barrier(context.SHADER_STORAGE_BARRIER_BIT | context.BUFFER_UPDATE_BARRIER_BIT)
        else:
            self._exposure.write(np.float32(exposure).tobytes())
        set_uniforms(self._program, radiance=0)
        display.bind_to_image(0, read=False, write=True)
        self._program.run(-(-display.width // 8), -(-display.height // 8))
        context.memory_barrier(context.TEXTURE_FETCH_BARRIER_BIT)

    def read_exposure(self) -> float:
        """What radiance was multiplied by last: waits for the GPU."""
        return float(np.frombuffer(self._exposure.read(4), np.float32)[0])
