"""VPL importance: which light of the RSM the camera would miss most, as a factor of the chance to draw it."""

import moderngl

from vpltune.renderer.frame.point_table import R2_STEPS
from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.camera_uniforms import CameraUniforms
from vpltune.renderer.gpu.render_targets import GBuffer, ReflectiveShadowMap
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms

CELLS = 64
"""Along the side of an RSM face, each with one importance."""
CELLS_OF_MANY = 32
"""The same where there are more than `FEW_FACES`: a point light has six."""
FEW_FACES = 2
RECEIVERS = 128
"""Surface points that stand for the image."""
SPREAD = 16.0
"""Times a cell's area over which its light is spread: about a VPL's own, where there are a few hundred. At a
quarter and at four times it, the error of 32 VPLs was the same within its noise."""
DARK_SHARE = 0.01
"""Of the squared mean irradiance, as relMSE has it: a black point is not infinitely important."""
LEAST_IMPORTANCE = 0.05
"""Of the mean over the lit cells, added to each: light that matters little, or is taken to, is drawn seldom
and not never, so that sums stay right in the mean and no VPL grows too bright."""
DEFINES = {
    "IMPORTANCE_RECEIVERS": RECEIVERS,
    "IMPORTANCE_SPREAD": SPREAD,
    "IMPORTANCE_DARK_SHARE": DARK_SHARE,
    "LEAST_IMPORTANCE": LEAST_IMPORTANCE,
    "R2_STEP_X": R2_STEPS[0],
    "R2_STEP_Y": R2_STEPS[1],
}

_CELL_BYTES = 32
_RECEIVER_BYTES = 32


def importance_cells(face_count: int) -> int:
    """Cells along the side of each RSM face, where there are so many."""
    return CELLS if face_count <= FEW_FACES else CELLS_OF_MANY


class VplImportancePass:
    """G-buffer, RSM → a factor of the sampling weight for every cell of the RSM.

    Placing VPLs by what the camera sees is Segovia et al. 2006 ("Bidirectional instant radiosity"); here the
    chances are those of least variance, from points spread over the image and without visibility.
    """

    def __init__(self, context: moderngl.Context, rsm: ReflectiveShadowMap):
        self._context = context
        cells = importance_cells(rsm.face_count)
        self._cell_count = rsm.face_count * cells**2
        defines = {
            **buffer_bindings.DEFINES,
            **DEFINES,
            "RSM_RESOLUTION": rsm.resolution,
            "IMPORTANCE_CELLS": cells,
        }
        self._cells = load_compute(context, "vpl_importance/vpl_importance_cells", defines)
        self._receivers = load_compute(context, "vpl_importance/vpl_importance_receivers", defines)
        self._importance = load_compute(context, "vpl_importance/vpl_importance", defines)
        self._factor = load_compute(context, "vpl_importance/vpl_importance_factor", defines)
        count = max(1, self._cell_count)
        self._buffers = {
            buffer_bindings.IMPORTANCE_CELLS: context.buffer(reserve=count * _CELL_BYTES),
            buffer_bindings.IMPORTANCE_RECEIVERS: context.buffer(reserve=RECEIVERS * _RECEIVER_BYTES),
        }
        self.factor = context.buffer(reserve=count * 4)

    def draw(
        self,
        camera: CameraUniforms,
        gbuffer: GBuffer,
        rsm: ReflectiveShadowMap,
    ) -> None:
        """Measure the importance of the light in `rsm`, to the power of the η that is bound."""
        for binding, buffer in self._buffers.items():
            buffer.bind_to_storage_buffer(binding)
        self.bind()
        groups = -(-self._cell_count // 64)
        rsm.bind(self._cells, 0)
        self._run(self._cells, groups)
        camera.bind_gbuffer(self._receivers, gbuffer, 0)
        set_uniforms(self._receivers, cell_count=self._cell_count)
        self._run(self._receivers, RECEIVERS)
        set_uniforms(self._importance, cell_count=self._cell_count)
        self._run(self._importance, groups)
        set_uniforms(self._factor, cell_count=self._cell_count)
        self._run(self._factor, 1)

    def bind(self) -> None:
        """Bind what VPL placement reads."""
        self.factor.bind_to_storage_buffer(buffer_bindings.VPL_IMPORTANCE)

    def _run(self, program: moderngl.ComputeShader, groups: int) -> None:
        program.run(groups)
        self._context.memory_barrier(self._context.SHADER_STORAGE_BARRIER_BIT)
