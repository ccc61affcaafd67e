"""Scene statistics: ratios without units, measured of the frame's receivers and VPLs on the GPU."""

import moderngl
import numpy as np
from jaxtyping import Float32

from vpltune.renderer.config.artist_parameters import parameter_spec
from vpltune.renderer.config.scene_statistics import (
    MOMENT_VPLS,
    PARTNERS,
    RECEIVERS,
    STATISTIC_NAMES,
    STRIDE,
    VPLS,
)
from vpltune.renderer.frame.point_table import R2_STEPS
from vpltune.renderer.frame.visibility_map_layout import VisibilityMapLayout
from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.camera_uniforms import CameraUniforms
from vpltune.renderer.gpu.render_targets import GBuffer
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms

_GROUP_SIZE = 64
_GROUPS = RECEIVERS // _GROUP_SIZE
_SUMS_BYTES = 9 * 4
"""Of one workgroup: `ReceiverSums` in shaders/common/scene_statistics.glsl."""

STATISTICS_DEFINES = {
    **buffer_bindings.DEFINES,
    "STATISTIC_COUNT": len(STATISTIC_NAMES),
    "STATISTICS_GROUP_SIZE": _GROUP_SIZE,
    "STATISTICS_GROUPS": _GROUPS,
    "STATISTICS_VPLS": VPLS,
    "STATISTICS_STRIDE": STRIDE,
    "STATISTICS_MOMENT_VPLS": MOMENT_VPLS,
    "STATISTICS_PARTNERS": PARTNERS,
    "STATISTICS_BIAS": float(parameter_spec("visibility_bias").default),
    "STATISTICS_SOFTNESS": float(parameter_spec("visibility_softness").default),
    "R2_STEP_X": R2_STEPS[0],
    "R2_STEP_Y": R2_STEPS[1],
    **{f"STATISTIC_{name.upper()}": index for index, name in enumerate(STATISTIC_NAMES)},
}


class SceneStatisticsPass:
    """G-buffer, VPLs, visibility maps → the statistics of `renderer.config.scene_statistics`.

    `visibility` as in the gather; without maps all light is taken to be seen.
    """

    def __init__(self, context: moderngl.Context, visibility: VisibilityMapLayout):
        self._context = context
        defines = {**STATISTICS_DEFINES, **visibility.defines}
        self._sums = load_compute(context, "auto_parameters/scene_statistics", defines)
        self._ratios = load_compute(context, "auto_parameters/scene_statistics_ratios", defines)
        self._buffer = context.buffer(reserve=4 * len(STATISTIC_NAMES) + _GROUPS * _SUMS_BYTES)

    def draw(self, camera: CameraUniforms, gbuffer: GBuffer, vpl_count: int) -> None:
        """Measure the frame whose VPLs are bound."""
        self.bind()
        camera.bind_gbuffer(self._sums, gbuffer, 0)
        for program, groups in ((self._sums, _GROUPS), (self._ratios, 1)):
            set_uniforms(program, vpl_count=vpl_count)
            program.run(groups)
            # What is measured may be read back.
            self._context.memory_barrier(
                self._context.SHADER_STORAGE_BARRIER_BIT | self._context.BUFFER_UPDATE_BARRIER_BIT
            )

    def bind(self) -> None:
        """Bind what the prior reads."""
        self._buffer.bind_to_storage_buffer(buffer_bindings.SCENE_STATISTICS)

    def read(self) -> Float32[np.ndarray, " statistics"]:
        """The statistics in their order: waits for the GPU."""
        return np.frombuffer(self._buffer.read(4 * len(STATISTIC_NAMES)), np.float32)
