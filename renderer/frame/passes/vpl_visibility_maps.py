"""VPL visibility maps: the surfaces every VPL sees, in a small hemispherical map, cast anew each frame."""

from vpltune.renderer.config.artist_parameters import parameter_spec
from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.visibility_map_layout import MAP_READS, TEXEL_BYTES, VisibilityMapLayout
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.ray_hierarchy import RayHierarchy
from vpltune.renderer.gpu.render_targets import EMPTY_DISPATCH
from vpltune.renderer.gpu.resources import Resources
from vpltune.renderer.gpu.shader_library import MOST_WORKGROUPS

_MARKS_BYTES = 8
"""Bytes of the marks of a map's row."""


class VplVisibilityMapsPass(FramePass):
    """VPLs, ray hierarchy, receiver bounds → one map of surfaces for each VPL, finer at silhouettes.

    The maps hold what imperfect shadow maps (Ritschel et al. 2008) hold. They are cast as rays and not
    splatted from points, so a map has no holes and needs few texels. Texels beside which one surface hides
    another are cast once more, `refinement`² rays for each. Texels that no visible receiver can look up are
    not cast.
    """

    name = "vpl_visibility_maps"

    def __init__(
        self, resources: Resources, vpl_count: int, layout: VisibilityMapLayout, hierarchy: RayHierarchy
    ):
        self._resources = resources
        self._hierarchy = hierarchy
        self._vpl_count = vpl_count
        blocks = layout.blocks(vpl_count)
        context = resources.context
        resources["visibility_maps"] = context.buffer(reserve=vpl_count * layout.size**2 * TEXEL_BYTES)
        # OpenGL buffers cannot be empty.
        detail_texels = max(1, blocks * layout.refinement**2)
        resources["visibility_details"] = context.buffer(reserve=detail_texels * TEXEL_BYTES)
        resources["visibility_edges"] = context.buffer(reserve=len(EMPTY_DISPATCH) + 4 * blocks)
        resources["visibility_marks"] = context.buffer(reserve=vpl_count * layout.size * _MARKS_BYTES)
        cast_reads = (*hierarchy.reads, "frame_statistics", "virtual_point_lights")
        defines = {**hierarchy.defines, **layout.defines, "VISIBILITY_BLOCKS": blocks}
        self._marks = ComputeProgram(
            resources,
            "vpl_visibility_maps/vpl_visibility_marks",
            {**layout.defines, "DISC_LARGEST_FALLOFF": parameter_spec("falloff_footprint").high},
            reads=("virtual_point_lights", "receiver_bounds", *MAP_READS),
            writes=("visibility_marks",),
        )
        self._maps = ComputeProgram(
            resources,
            "vpl_visibility_maps/vpl_visibility_maps",
            defines,
            reads=(*cast_reads, "visibility_details", "visibility_marks"),
            writes=("visibility_maps",),
        )
        self._edges = ComputeProgram(
            resources,
            "vpl_visibility_maps/vpl_visibility_edges",
            defines,
            reads=("frame_statistics", "visibility_details", "visibility_marks"),
            writes=("visibility_maps", "visibility_edges"),
        )
        self._refines = blocks > 0
        if not self._refines:
            return
        self._details = ComputeProgram(
            resources,
            "vpl_visibility_maps/vpl_visibility_details",
            defines,
            reads=(*cast_reads, "visibility_edges", "visibility_maps"),
            writes=("visibility_details",),
        )

    def draw(self, inputs: FrameInputs) -> None:
        """Cast the maps."""
        self._hierarchy.update()
        columns = min(self._vpl_count, MOST_WORKGROUPS)
        groups = (columns, -(-self._vpl_count // columns))
        uniforms = {"longest": inputs.scene_diagonal, "vpl_count": self._vpl_count}
        self._marks.dispatch(*groups, vpl_count=self._vpl_count)
        self._maps.dispatch(*groups, **uniforms)
        if self._refines:
            self._resources.write("visibility_edges", EMPTY_DISPATCH)
        self._edges.dispatch(*groups, **uniforms)
        if self._refines:
            self._details.dispatch_indirect("visibility_edges", longest=inputs.scene_diagonal)
