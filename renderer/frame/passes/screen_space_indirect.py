"""Screen-space indirect: the near field that softened VPLs withhold, from directly lit pixels nearby."""

import moderngl

from vpltune.renderer.frame.point_table import R2_STEPS
from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.camera_uniforms import CameraUniforms
from vpltune.renderer.gpu.render_targets import GBuffer, LightAccumulation, create_irradiance_target
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms

BLOCK = 4
"""Pixels along the side of a block that shares the samples out; its image is for the interleaved filter."""
SAMPLES = 16
"""Of each pixel: 256 within a block."""
NEAREST_PIXEL = 0.7
"""Where sampling starts, in pixels: nearer, a pixel would mostly find itself, which gives it nothing."""


class ScreenSpaceIndirectPass:
    """G-buffer, direct irradiance, VPLs → interleaved irradiance from nearby pixels."""

    def __init__(
        self, context: moderngl.Context, size: tuple[int, int], rsm_resolution: int, importance_cells: int
    ):
        self._context = context
        defines = {
            **buffer_bindings.DEFINES,
            "RSM_RESOLUTION": rsm_resolution,
            "IMPORTANCE_CELLS": importance_cells,
        }
        self._mean_footprint = load_compute(context, "virtual_point_lights/vpl_mean_footprint", defines)
        self._emitters = load_compute(context, "screen_space_indirect/screen_space_emitters", defines)
        self._program = load_compute(
            context,
            "screen_space_indirect/screen_space_indirect",
            {
                **defines,
                "BLOCK": BLOCK,
                "SAMPLES": SAMPLES,
                "NEAREST_PIXEL": NEAREST_PIXEL,
                "R2_STEP_X": R2_STEPS[0],
                "R2_STEP_Y": R2_STEPS[1],
            },
        )
        self._footprint = context.buffer(reserve=16)
        self._emitter_image = create_irradiance_target(context, size)

    def draw(
        self,
        camera: CameraUniforms,
        gbuffer: GBuffer,
        direct_irradiance: moderngl.Texture,
        accumulated: LightAccumulation | None,
        light_count: int,
        vpl_count: int,
        interleaved_irradiance: moderngl.Texture,
    ) -> None:
        """Gather for the lights, faces, VPLs and parameters that are bound.

        `accumulated` light has no VPLs and is left out.
        """
        context = self._context
        groups = (-(-interleaved_irradiance.width // 8), -(-interleaved_irradiance.height // 8))
        self._footprint.bind_to_storage_buffer(buffer_bindings.VPL_FOOTPRINT)
        set_uniforms(self._mean_footprint, vpl_count=vpl_count)
        self._mean_footprint.run(1)

        camera.bind_gbuffer(self._emitters, gbuffer, 0)
        gbuffer.albedo.use(2)
        direct_irradiance.use(3)
        if accumulated is not None:
            accumulated.texture.use(4)
        set_uniforms(
            self._emitters,
            gbuffer_albedo=2,
            direct_irradiance=3,
            light_accumulation=4,
            accumulation_unit=0.0 if accumulated is None else accumulated.unit,
            vpl_count=vpl_count,
            light_count=light_count,
        )
        self._emitter_image.bind_to_image(0, read=False, write=True)
        self._emitters.run(*groups)
        context.memory_barrier(context.TEXTURE_FETCH_BARRIER_BIT | context.SHADER_STORAGE_BARRIER_BIT)

        camera.bind_gbuffer(self._program, gbuffer, 0)
        self._emitter_image.use(2)
        set_uniforms(self._program, emitters=2)
        interleaved_irradiance.bind_to_image(0, read=False, write=True)
        self._program.run(*groups)
        context.memory_barrier(context.TEXTURE_FETCH_BARRIER_BIT)
