"""Screen-space indirect: the near field that softened VPLs withhold, from directly lit pixels nearby."""

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.point_table import R2_STEPS
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import (
    GBUFFER_READS,
    RSM_READS,
    ReflectiveShadowMap,
    create_irradiance_target,
    pixel_groups,
)
from vpltune.renderer.gpu.resources import Resources

BLOCK = 4
"""Pixels along the side of a block that shares the samples out; its image is for the interleaved filter."""
SAMPLES = 16
"""Samples of each pixel: 256 in a block. A choice."""
NEAREST_PIXEL = 0.7
"""Where sampling starts, in pixels: nearer, a pixel would mostly find itself, which gives it nothing."""


class ScreenSpaceIndirectPass(FramePass):
    """G-buffer, direct irradiance, VPLs → `shared_irradiance` from nearby pixels, for the filter.

    The dynamic lights' irradiance has no VPLs and is left out. `punctual` is the resource with direct light
    of lamps and sky: glowing surfaces have discs, which withhold nothing.
    """

    name = "screen_space_indirect"

    def __init__(
        self,
        resources: Resources,
        rsm: ReflectiveShadowMap,
        importance_cells: int,
        punctual: str = "direct_irradiance",
    ):
        self._rsm = rsm
        target = resources.texture("vpl_irradiance")
        resources["vpl_footprint"] = resources.context.buffer(reserve=16)
        resources["emitters"] = create_irradiance_target(resources.context, target.size)
        self._groups = pixel_groups(target)
        self._footprint = ComputeProgram(
            resources,
            "virtual_point_lights/vpl_mean_footprint",
            reads=("virtual_point_lights",),
            writes=("vpl_footprint",),
        )
        parameters = ("artist_parameters", "frame_statistics")
        self._emitters = ComputeProgram(
            resources,
            "screen_space_indirect/screen_space_emitters",
            {"RSM_RESOLUTION": rsm.resolution, "IMPORTANCE_CELLS": importance_cells},
            reads=(
                *GBUFFER_READS,
                *RSM_READS,
                *parameters,
                "vpl_importance",
                "gbuffer_albedo",
                punctual if punctual == "direct_irradiance" else f"{punctual} as direct_irradiance",
                "light_accumulation",
            ),
            writes=("emitters",),
        )
        self._program = ComputeProgram(
            resources,
            "screen_space_indirect/screen_space_indirect",
            {
                "BLOCK": BLOCK,
                "SAMPLES": SAMPLES,
                "NEAREST_PIXEL": NEAREST_PIXEL,
                "R2_STEP_X": R2_STEPS[0],
                "R2_STEP_Y": R2_STEPS[1],
            },
            reads=(*GBUFFER_READS, *parameters, "vpl_footprint", "emitters"),
            writes=("shared_irradiance as irradiance",),
        )

    def wanted(self, inputs: FrameInputs) -> bool:
        """Where a near field is asked for. Discs withhold nothing that it would have to give back."""
        return inputs.parameters.screen_space_strength > 0.0 and not inputs.parameters.vpls_are_discs

    def draw(self, inputs: FrameInputs) -> None:
        """Sample the neighbourhood of every pixel."""
        uniforms = {
            **inputs.camera.uniforms,
            **self._rsm.uniforms,
            "vpl_count": inputs.parameters.vpl_count,
            "light_count": inputs.light_count,
            "accumulation_unit": inputs.accumulation_unit,
        }
        self._footprint.dispatch(1, **uniforms)
        self._emitters.dispatch(*self._groups, **uniforms)
        self._program.dispatch(*self._groups, **uniforms)
