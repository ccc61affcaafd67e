"""VPL importance: which light of the RSM the camera would miss most, as a factor of the chance to draw it."""

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.point_table import R2_STEPS
from vpltune.renderer.frame.rsm_resolution import FEW_FACES
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import GBUFFER_READS, RSM_READS, ReflectiveShadowMap
from vpltune.renderer.gpu.resources import Resources

CELLS = 64
"""Cells along the side of an RSM face, each with one importance. A choice."""
CELLS_OF_MANY = 32
"""The same with more than `FEW_FACES`. A choice."""
MOST_CELLS = 1 << 20
"""Cells of all faces, beyond which each face has half as many along its side, and so on. A choice: a quarter
of the 65,535 workgroups that every driver takes in one dispatch."""
RECEIVERS = 128
"""Surface points that stand for the image. A choice."""
SPREAD = 16.0
"""Area over which a cell's light is spread, in areas of a cell: about that of one of a few hundred VPLs. At a
quarter and at four times it, the error of 32 VPLs was the same within its noise."""
DARK_SHARE = 0.01
"""Share of the mean squared irradiance that is added to a receiver's own: a black point is not infinitely
important."""
LEAST_IMPORTANCE = 0.05
"""Least share of the VPLs that is drawn by flux alone, whatever η is. Light that seems to matter little is
drawn seldom, but never not at all, so that the mean stays right and no VPL grows too bright. A choice."""
LARGEST_LAG = 0.1
"""Share of the VPLs that a clip may draw elsewhere than a still of the same frame. The larger, the rarer is a
new importance, which shows as one change. A choice (docs/design_decisions.md, Placement)."""
DEFINES = {
    "IMPORTANCE_RECEIVERS": RECEIVERS,
    "IMPORTANCE_SPREAD": SPREAD,
    "IMPORTANCE_DARK_SHARE": DARK_SHARE,
    "LEAST_IMPORTANCE": LEAST_IMPORTANCE,
    "R2_STEP_X": R2_STEPS[0],
    "R2_STEP_Y": R2_STEPS[1],
}

_CELL_BYTES, _RECEIVER_BYTES = 32, 32
"""Bytes of the structures in shaders/common/vpl_importance_form.glsl."""


def importance_cells(outer_faces: int) -> int:
    """Cells along the side of each RSM face, where so many lie in no other."""
    cells = CELLS if outer_faces <= FEW_FACES else CELLS_OF_MANY
    while outer_faces * cells**2 > MOST_CELLS:
        cells //= 2
    return cells


class VplImportancePass(FramePass):
    """G-buffer, RSM → a factor of the sampling weight for every cell of the RSM.

    Placing VPLs by what the camera sees is Segovia et al. 2006 ("Bidirectional instant radiosity"); here
    the density is that of least variance, from points spread over the image, without visibility.
    """

    name = "vpl_importance"

    def __init__(self, resources: Resources, rsm: ReflectiveShadowMap, cells: int):
        self._resources = resources
        self._rsm = rsm
        self._cell_count = rsm.face_count * cells**2
        context, count = resources.context, max(1, self._cell_count)
        resources["importance_cells"] = context.buffer(reserve=count * _CELL_BYTES)
        resources["importance_receivers"] = context.buffer(reserve=RECEIVERS * _RECEIVER_BYTES)
        resources["vpl_importance"] = context.buffer(reserve=count * 4)
        defines = {
            **DEFINES,
            "RSM_RESOLUTION": rsm.resolution,
            "IMPORTANCE_CELLS": cells,
            "LARGEST_LAG": LARGEST_LAG,
        }

        def program(stage: str, reads: tuple[str, ...], *writes: str) -> ComputeProgram:
            return ComputeProgram(
                resources, f"vpl_importance/vpl_importance{stage}", defines, reads=reads, writes=writes
            )

        measured = ("importance_cells", "importance_receivers")
        self._cells = program("_cells", (*RSM_READS, "importance_receivers"), "importance_cells")
        self._receivers = program("_receivers", (*GBUFFER_READS, "importance_cells"), "importance_receivers")
        reads = ("artist_parameters", *RSM_READS, *measured)
        self._importance = program("", reads, "vpl_importance")
        self._factor = program("_factor", reads, "vpl_importance")
        self._carried = program("_carried", reads, "vpl_importance", "carried_importance")

    def wanted(self, inputs: FrameInputs) -> bool:
        """Where the density heeds it."""
        return inputs.parameters.density_importance > 0.0

    def draw(self, inputs: FrameInputs) -> None:
        """Measure the importance of the light in the RSM, and mix it with its flux.

        While lights stand still, a clip keeps the result of the frame before until it is more than
        `LARGEST_LAG` away from this one. Under a light that moves, kept cells would move samples with it.
        """
        uniforms = {**inputs.camera.uniforms, **self._rsm.uniforms, "cell_count": self._cell_count}
        groups = -(-self._cell_count // 64)
        self._cells.dispatch(groups, **uniforms)
        self._receivers.dispatch(RECEIVERS, **uniforms)
        self._importance.dispatch(groups, **uniforms)
        self._factor.dispatch(1, **uniforms)
        if inputs.state is not None:
            name, size = f"vpl_importance_{self._cell_count}", 4 * max(1, self._cell_count)
            carried = inputs.state.buffer(self._resources.context, name, size)
            self._resources["carried_importance"] = carried
            if inputs.state.lights_stand_still(inputs.records):
                self._carried.dispatch(1, cell_count=self._cell_count)
            else:
                self._resources.copy("vpl_importance", "carried_importance")
