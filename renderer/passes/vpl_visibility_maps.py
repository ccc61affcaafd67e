"""VPL visibility maps: the surfaces every VPL sees, in a small hemispherical map, cast anew each frame."""

import moderngl

from renderer import buffer_bindings
from renderer.ray_hierarchy import RAY_DEFINES, RayHierarchy
from renderer.shader_library import load_compute, set_uniforms

TEXEL_BYTES = 8
"""A distance and a packed normal, see shaders/common/vpl_visibility.glsl."""


class VplVisibilityMapsPass:
    """VPLs, ray hierarchy → one `size`² map of surfaces for each VPL.

    Imperfect shadow maps (Ritschel et al. 2008) in what they hold; not splatted from points but cast as
    rays, so that a map has no holes and as few texels as it can do with.
    """

    def __init__(self, context: moderngl.Context, vpl_count: int, size: int):
        self._context = context
        self._vpl_count = vpl_count
        self.size = size
        defines = {**RAY_DEFINES, "VISIBILITY_MAP_SIZE": size}
        self._program = load_compute(context, "vpl_visibility_maps", defines)
        self.maps = context.buffer(reserve=vpl_count * size * size * TEXEL_BYTES)

    def draw(self, hierarchy: RayHierarchy, longest: float) -> None:
        """Cast the maps of the VPLs that are bound; `longest` is the scene's diagonal in world units."""
        hierarchy.bind()
        self.bind()
        set_uniforms(self._program, longest=longest)
        self._program.run(self._vpl_count)
        self._context.memory_barrier(self._context.SHADER_STORAGE_BARRIER_BIT)

    def bind(self) -> None:
        """Bind what the gather reads."""
        self.maps.bind_to_storage_buffer(buffer_bindings.VISIBILITY_MAPS)
