"""Virtual point lights drawn from the RSM on the GPU: density over texels, then a warped point table."""

import moderngl

from vpltune.renderer.frame.point_table import PointTable, point_table, r2_sequence
from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.render_targets import ReflectiveShadowMap
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms

ROW_GROUP_SIZE = 64
VPL_BYTES = 48
FRAME_STATISTICS_BYTES = 16
_ROW_MOMENTS_BYTES = 32


class VirtualPointLightsPass:
    """RSM atlas → `count` VPLs and the frame's statistics (total flux, scene length L).

    Each has flux and area of the `rsm_filtering`² texels around its own, in the mean; an odd number.
    """

    def __init__(
        self,
        context: moderngl.Context,
        rsm: ReflectiveShadowMap,
        count: int,
        table: PointTable = "r2",
        rsm_filtering: int = 1,
        importance_cells: int = 1,
    ):
        self._context = context
        self.count = count
        defines = {
            **buffer_bindings.DEFINES,
            "RSM_RESOLUTION": rsm.resolution,
            "RSM_FILTERING": rsm_filtering,
            "ROW_GROUP_SIZE": ROW_GROUP_SIZE,
            "IMPORTANCE_CELLS": importance_cells,
        }
        self._row_density = load_compute(context, "virtual_point_lights/vpl_row_density", defines)
        self._marginal_density = load_compute(context, "virtual_point_lights/vpl_marginal_density", defines)
        self._placement = load_compute(context, "virtual_point_lights/virtual_point_lights", defines)
        columns, rows = rsm.depth.width, rsm.rows
        self._buffers = {
            buffer_bindings.POINT_TABLE: context.buffer(point_table(table, count).tobytes()),
            buffer_bindings.ROW_CDF: context.buffer(reserve=rows * columns * 4),
            buffer_bindings.ROW_MOMENTS: context.buffer(reserve=rows * _ROW_MOMENTS_BYTES),
            buffer_bindings.MARGINAL_CDF: context.buffer(reserve=rows * 4),
        }
        self.frame_statistics = context.buffer(reserve=FRAME_STATISTICS_BYTES)
        self.virtual_point_lights = context.buffer(reserve=count * VPL_BYTES)
        self.samples: moderngl.Buffer | None = None
        self._sample_table: moderngl.Buffer | None = None

    def distribute(self, rsm: ReflectiveShadowMap, moment_origin: tuple[float, float, float]) -> None:
        """How VPLs are spread over the RSM, by the densities γ and η and the importance that are bound.

        A texel's chance is ∝ flux^γ · F.
        """
        self._bind_density()
        context = self._context
        rsm.bind(self._row_density, 0)
        set_uniforms(self._row_density, moment_origin=moment_origin)
        self._row_density.run(rsm.rows)
        context.memory_barrier(context.SHADER_STORAGE_BARRIER_BIT)
        set_uniforms(self._marginal_density, rows=rsm.rows)
        self._marginal_density.run(1)
        context.memory_barrier(context.SHADER_STORAGE_BARRIER_BIT)

    def draw(
        self, rsm: ReflectiveShadowMap, table_rotation: tuple[float, float], sample_count: int = 0
    ) -> None:
        """Place the VPLs, as they were last distributed over `rsm`.

        `table_rotation` shifts the point table on its torus, in [0, 1)². Where `sample_count` is not 0, so
        many are placed in `samples` instead, from the R2 sequence, which share all light among them.
        """
        self._bind_density()
        rsm.bind(self._placement, 0)
        set_uniforms(self._placement, rows=rsm.rows, table_rotation=table_rotation)
        if sample_count > 0:
            self._place_samples(sample_count)
        else:
            self._place(self.count)

    def bind(self) -> None:
        """Bind what the gather reads."""
        self.frame_statistics.bind_to_storage_buffer(buffer_bindings.FRAME_STATISTICS)
        self.virtual_point_lights.bind_to_storage_buffer(buffer_bindings.VIRTUAL_POINT_LIGHTS)

    def _bind_density(self) -> None:
        for binding, buffer in self._buffers.items():
            buffer.bind_to_storage_buffer(binding)
        self.bind()

    def _place(self, count: int) -> None:
        set_uniforms(self._placement, vpl_count=count)
        self._placement.run(-(-count // 64))
        self._context.memory_barrier(self._context.SHADER_STORAGE_BARRIER_BIT)

    def _place_samples(self, count: int) -> None:
        if self.samples is None or self._sample_table is None:
            self.samples = self._context.buffer(reserve=count * VPL_BYTES)
            self._sample_table = self._context.buffer(r2_sequence(count).tobytes())
        self._sample_table.bind_to_storage_buffer(buffer_bindings.POINT_TABLE)
        self.samples.bind_to_storage_buffer(buffer_bindings.VIRTUAL_POINT_LIGHTS)
        self._place(count)
        self.bind()
