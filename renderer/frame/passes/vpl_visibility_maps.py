"""VPL visibility maps: the surfaces every VPL sees, in a small hemispherical map, cast anew each frame."""

import moderngl
import numpy as np

from vpltune.renderer.frame.visibility_map_layout import TEXEL_BYTES, VisibilityMapLayout
from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.ray_hierarchy import RAY_DEFINES, RayHierarchy
from vpltune.renderer.gpu.shader_library import MOST_WORKGROUPS, load_compute, set_uniforms

_NO_EDGES = np.array([0, 1, 1, 0], np.uint32).tobytes()
"""No workgroup of an indirect dispatch, and no texel: shaders/common/visibility_edges.glsl."""


class VplVisibilityMapsPass:
    """VPLs, ray hierarchy → one map of surfaces for each VPL, finer at silhouettes.

    Imperfect shadow maps (Ritschel et al. 2008) in what they hold; not splatted from points but cast as
    rays, so that a map has no holes and as few texels as it can do with. Texels beside which one surface
    hides another are cast once more, `refinement`² rays for each.
    """

    def __init__(self, context: moderngl.Context, vpl_count: int, layout: VisibilityMapLayout):
        self._context = context
        self._vpl_count = vpl_count
        self.layout = layout
        self.blocks = layout.blocks(vpl_count)
        defines = {**RAY_DEFINES, **layout.defines, "VISIBILITY_BLOCKS": self.blocks}
        self._maps_program = load_compute(context, "vpl_visibility_maps/vpl_visibility_maps", defines)
        self.maps = context.buffer(reserve=vpl_count * layout.size**2 * TEXEL_BYTES)
        # A binding must have something in it.
        self.details = context.buffer(reserve=max(1, self.blocks * layout.refinement**2) * TEXEL_BYTES)
        self._edges = context.buffer(reserve=len(_NO_EDGES) + 4 * self.blocks)
        self._refines = self.blocks > 0
        if self._refines:
            self._edges_program = load_compute(context, "vpl_visibility_maps/vpl_visibility_edges", defines)
            self._details_program = load_compute(
                context, "vpl_visibility_maps/vpl_visibility_details", defines
            )

    def draw(self, hierarchy: RayHierarchy, longest: float) -> None:
        """Cast the maps of the VPLs that are bound; `longest` is the scene's diagonal in world units."""
        hierarchy.bind()
        self.bind()
        context = self._context
        self._run_for_maps(self._maps_program, longest)
        context.memory_barrier(context.SHADER_STORAGE_BARRIER_BIT)
        if self._refines:
            self._edges.write(_NO_EDGES)
            self._edges.bind_to_storage_buffer(buffer_bindings.VISIBILITY_EDGES)
            self._run_for_maps(self._edges_program, longest)
            # The next frame empties the list before it is filled.
            context.memory_barrier(
                context.SHADER_STORAGE_BARRIER_BIT
                | context.COMMAND_BARRIER_BIT
                | context.BUFFER_UPDATE_BARRIER_BIT
            )
            set_uniforms(self._details_program, longest=longest)
            self._details_program.run_indirect(self._edges)
            context.memory_barrier(context.SHADER_STORAGE_BARRIER_BIT)

    def bind(self) -> None:
        """Bind what the gather reads."""
        self.maps.bind_to_storage_buffer(buffer_bindings.VISIBILITY_MAPS)
        self.details.bind_to_storage_buffer(buffer_bindings.VISIBILITY_DETAILS)

    def _run_for_maps(self, program: moderngl.ComputeShader, longest: float) -> None:
        set_uniforms(program, longest=longest, vpl_count=self._vpl_count)
        columns = min(self._vpl_count, MOST_WORKGROUPS)
        program.run(columns, -(-self._vpl_count // columns))
