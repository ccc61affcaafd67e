"""Virtual point lights drawn from the RSM on the GPU: density over texels, then a warped point table."""

import numpy as np
from jaxtyping import Float32

from vpltune.renderer.frame.disc_samples import sample_count
from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.point_table import PointTable, point_table, r2_sequence
from vpltune.renderer.frame.vpl_pools import VPL_BYTES
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import RSM_READS, ReflectiveShadowMap
from vpltune.renderer.gpu.resources import Resources

ROW_GROUP_SIZE = 64
"""Invocations that sum one row of the atlas. A choice."""
FRAME_STATISTICS_BYTES = 32
"""Bytes of `shaders/common/scene_length.glsl`."""
_ROW_MOMENTS_BYTES = 32
"""Bytes of a row in shaders/virtual_point_lights/vpl_row_density.comp."""
_DENSITY_READS = (*RSM_READS, "artist_parameters", "vpl_importance")
_PLACEMENT_READS = (*_DENSITY_READS, "row_cdf", "marginal_cdf", "frame_statistics")


class VplDensityPass(FramePass):
    """RSM atlas → the chance of each texel, ∝ flux^γ · importance, as running sums; total flux and L."""

    name = "virtual_point_lights"

    def __init__(self, resources: Resources, rsm: ReflectiveShadowMap, importance_cells: int):
        self._rsm = rsm
        context, rows = resources.context, rsm.rows
        resources["row_cdf"] = context.buffer(reserve=rows * rsm.depth.width * 4)
        resources["row_moments"] = context.buffer(reserve=rows * _ROW_MOMENTS_BYTES)
        resources["marginal_cdf"] = context.buffer(reserve=rows * 4)
        resources["frame_statistics"] = context.buffer(reserve=FRAME_STATISTICS_BYTES)
        defines = {
            "RSM_RESOLUTION": rsm.resolution,
            "ROW_GROUP_SIZE": ROW_GROUP_SIZE,
            "IMPORTANCE_CELLS": importance_cells,
        }
        self._rows = ComputeProgram(
            resources,
            "virtual_point_lights/vpl_row_density",
            defines,
            reads=_DENSITY_READS,
            writes=("row_cdf", "row_moments"),
        )
        self._marginal = ComputeProgram(
            resources,
            "virtual_point_lights/vpl_marginal_density",
            defines,
            reads=("row_moments",),
            writes=("marginal_cdf", "frame_statistics"),
        )

    def draw(self, inputs: FrameInputs) -> None:
        """Sum each row, then the rows."""
        uniforms = {**self._rsm.uniforms, "moment_origin": inputs.records.moment_origin}
        self._rows.dispatch(self._rsm.rows, **uniforms)
        self._marginal.dispatch(1, rows=self._rsm.rows)


class VirtualPointLightsPass(FramePass):
    """RSM atlas, its density → `count` VPLs, or for clustered discs the samples that they are made of.

    Each has flux and area of the `rsm_filtering`² texels around its own, in the mean; an odd number.

    Args:
        resources: holds the RSM and its density.
        rsm: its layout.
        count: VPLs.
        table: from which points are taken.
        rsm_filtering: see above.
        importance_cells: along the side of a face.
        walk_starts: in [0, 1)², one for each walk of light that starts at a place the RSM shows; None for no
            walks.
    """

    name = "virtual_point_lights"

    def __init__(
        self,
        resources: Resources,
        rsm: ReflectiveShadowMap,
        count: int,
        table: PointTable,
        rsm_filtering: int,
        importance_cells: int,
        walk_starts: Float32[np.ndarray, "walks 2"] | None = None,
    ):
        self._resources = resources
        self._rsm = rsm
        self._count = count
        self._defines = {
            "RSM_RESOLUTION": rsm.resolution,
            "RSM_FILTERING": rsm_filtering,
            "IMPORTANCE_CELLS": importance_cells,
        }
        context = resources.context
        resources["point_table"] = context.buffer(point_table(table, count).tobytes())
        resources["first_vpls"] = context.buffer(reserve=count * VPL_BYTES)
        self._vpls = self._program("point_table", "first_vpls")
        self._samples: ComputeProgram | None = None
        self._walks = 0 if walk_starts is None else len(walk_starts)
        if walk_starts is not None:
            resources["lamp_starts"] = context.buffer(reserve=self._walks * VPL_BYTES)
            resources["lamp_table"] = context.buffer(np.ascontiguousarray(walk_starts).tobytes())
            self._starts = self._program("lamp_table", "lamp_starts")

    def draw(self, inputs: FrameInputs) -> None:
        """Place the VPLs, or the samples that the discs are made of; and where walks start."""
        if self._walks:
            self._dispatch(self._starts, self._walks, inputs)
        if not inputs.parameters.vpls_are_discs:
            self._dispatch(self._vpls, self._count, inputs)
            return
        if self._samples is None:
            samples, context = sample_count(self._count), self._resources.context
            self._resources["first_samples"] = context.buffer(reserve=samples * VPL_BYTES)
            self._resources["sample_table"] = context.buffer(r2_sequence(samples).tobytes())
            self._samples = self._program("sample_table", "first_samples")
        self._dispatch(self._samples, sample_count(self._count), inputs)

    def _program(self, table: str, target: str) -> ComputeProgram:
        return ComputeProgram(
            self._resources,
            "virtual_point_lights/virtual_point_lights",
            self._defines,
            reads=(
                *_DENSITY_READS,
                "row_cdf",
                "marginal_cdf",
                "frame_statistics",
                f"{table} as point_table",
            ),
            writes=(f"{target} as virtual_point_lights",),
        )

    def _dispatch(self, program: ComputeProgram, count: int, inputs: FrameInputs) -> None:
        program.dispatch(
            -(-count // 64),
            **self._rsm.uniforms,
            rows=self._rsm.rows,
            table_rotation=inputs.table_rotation,
            vpl_count=count,
        )
