"""Geometry-aware reconstruction of interleaved pictures (Keller and Heidrich 2001; Segovia et al. 2006)."""

import moderngl

from renderer import buffer_bindings
from renderer.camera_uniforms import CameraUniforms
from renderer.render_targets import GBuffer, PixelList
from renderer.shader_library import load_compute, set_uniforms

PLANE_TOLERANCE = 1.0
"""Pixel footprints that a neighbour may stand off a pixel's plane and still be on its surface."""
NORMAL_COSINE = 0.8
"""Least cosine between the normals of one surface: 37 degrees, wide enough for coarse round meshes."""
LARGEST_VARIANCE = 0.2
"""Of the mean over a window, relative to its square: beyond, a pixel is gathered in full. In rooms at
960×540 that is one pixel in a hundred, and they hold nine tenths of the squared error."""
FEWEST_SUBSETS = 1.0 / 3.0
"""Share of the subsets in a window below which a pixel is gathered in full."""


class InterleavedFilterPass:
    """G-buffer, interleaved picture → irradiance, and with `refine` the list of pixels it does not serve.

    With `add_base`, another irradiance picture is added to the result.
    """

    def __init__(
        self, context: moderngl.Context, interleave: int, *, refine: bool = False, add_base: bool = False
    ):
        self._context = context
        defines = {
            **buffer_bindings.DEFINES,
            "INTERLEAVE": interleave,
            "PLANE_TOLERANCE": PLANE_TOLERANCE,
            "NORMAL_COSINE": NORMAL_COSINE,
            "LARGEST_VARIANCE": LARGEST_VARIANCE,
            "FEWEST_SUBSETS": FEWEST_SUBSETS,
            "REFINE": refine,
            "ADD_BASE": add_base,
        }
        self._program = load_compute(context, "interleaved_filter", defines)

    def draw(
        self,
        camera: CameraUniforms,
        gbuffer: GBuffer,
        interleaved: moderngl.Texture,
        irradiance: moderngl.Texture,
        *,
        pixel_list: PixelList | None = None,
        base: moderngl.Texture | None = None,
    ) -> None:
        """`pixel_list` is emptied and filled where the pass refines; `base` is added where it adds."""
        camera.bind_gbuffer(self._program, gbuffer, 0)
        interleaved.use(2)
        if base is not None:
            base.use(3)
        if pixel_list is not None:
            pixel_list.clear()
            pixel_list.bind()
        set_uniforms(self._program, interleaved=2, base=3)
        irradiance.bind_to_image(0, read=False, write=True)
        self._program.run(-(-irradiance.width // 8), -(-irradiance.height // 8))
        context = self._context
        context.memory_barrier(
            context.TEXTURE_FETCH_BARRIER_BIT
            | context.SHADER_STORAGE_BARRIER_BIT
            | context.COMMAND_BARRIER_BIT
        )
