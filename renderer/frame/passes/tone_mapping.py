"""Tone mapping: exposure, measured on the GPU or given, then tone curve and sRGB."""

import numpy as np

from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import pixel_groups
from vpltune.renderer.gpu.resources import Resources

EXPOSURE_KEY = 0.25
"""Mean luminance of the image before the tone curve. A choice: a room's walls then look neither grey nor
burnt out."""
_EXPOSURE_BYTES = 16
"""Bytes of a float, rounded up as storage blocks are."""


class ToneMappingPass:
    """Radiance → 8-bit display image."""

    name = "tone_mapping"

    def __init__(self, resources: Resources):
        self._resources = resources
        resources["exposure"] = resources.context.buffer(reserve=_EXPOSURE_BYTES)
        self._groups = pixel_groups(resources.texture("display"))
        self._measure = ComputeProgram(
            resources,
            "display/exposure",
            {"EXPOSURE_KEY": EXPOSURE_KEY},
            reads=("radiance",),
            writes=("exposure",),
        )
        self._program = ComputeProgram(
            resources, "display/tone_mapping", reads=("radiance", "exposure"), writes=("display",)
        )

    def draw(self, exposure: float | None) -> None:
        """`exposure` multiplies radiance before the curve; None measures it from the image."""
        if exposure is None:
            self._measure.dispatch(1)
        else:
            self._resources.write("exposure", np.float32(exposure).tobytes())
        self._program.dispatch(*self._groups)
