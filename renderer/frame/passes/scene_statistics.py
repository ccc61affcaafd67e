"""Scene statistics: ratios without units, measured of the frame's receivers and VPLs on the GPU."""

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
from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.point_table import R2_STEPS
from vpltune.renderer.frame.visibility_map_layout import MAP_READS, VisibilityMapLayout
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import GBUFFER_READS
from vpltune.renderer.gpu.resources import Resources

_GROUP_SIZE = 64
"""Invocations of a workgroup. A choice."""
_GROUPS = RECEIVERS // _GROUP_SIZE
_SUMS_BYTES = 9 * 4
"""Bytes of a workgroup's `ReceiverSums` in shaders/common/scene_statistics.glsl."""

STATISTICS_DEFINES = {
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


class SceneStatisticsPass(FramePass):
    """G-buffer, VPLs, visibility maps → the statistics of `renderer.config.scene_statistics`.

    Without visibility maps all light is taken to be seen.
    """

    name = "scene_statistics"

    def __init__(self, resources: Resources, maps: VisibilityMapLayout):
        self._resources = resources
        size = 4 * len(STATISTIC_NAMES) + _GROUPS * _SUMS_BYTES
        resources["scene_statistics"] = resources.context.buffer(reserve=size)
        defines = {**STATISTICS_DEFINES, **maps.defines}
        reads = ("frame_statistics", "virtual_point_lights")
        self._sums = ComputeProgram(
            resources,
            "auto_parameters/scene_statistics",
            defines,
            reads=(*GBUFFER_READS, *reads, *(MAP_READS if maps.size else ())),
            writes=("scene_statistics",),
        )
        self._ratios = ComputeProgram(
            resources,
            "auto_parameters/scene_statistics_ratios",
            defines,
            reads=reads,
            writes=("scene_statistics",),
        )

    def draw(self, inputs: FrameInputs) -> None:
        """Measure the frame."""
        uniforms = {**inputs.camera.uniforms, "vpl_count": inputs.parameters.vpl_count}
        self._sums.dispatch(_GROUPS, **uniforms)
        self._ratios.dispatch(1, **uniforms)

    def read(self) -> Float32[np.ndarray, " statistics"]:
        """The statistics in their order: waits for the GPU."""
        return np.frombuffer(self._resources.read("scene_statistics", 4 * len(STATISTIC_NAMES)), np.float32)
