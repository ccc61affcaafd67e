"""Geometry-aware reconstruction of interleaved images (Keller and Heidrich 2001; Segovia et al. 2006)."""

import moderngl

from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.camera_uniforms import CameraUniforms
from vpltune.renderer.gpu.render_targets import GBuffer, PixelList
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms

PLANE_TOLERANCE = 1.0
"""Pixel footprints that a neighbour may stand off a pixel's plane and still be on its surface."""
NORMAL_COSINE = 0.8
"""Least cosine between the normals of one surface: 37 degrees, wide enough for coarse round meshes."""
LEAST_COSINE = 1e-3
"""Between light and normal: light that grazes a neighbour says little of other normals. Keeps it finite."""
LARGEST_RELIGHTING = 4.0
"""How much brighter than it is a neighbour may stand in for, where it grazes the light that a pixel faces."""
LEAST_VARIANCE = 0.1
"""Between subsets, over the mean squared: what two or three neighbours show can be alike by chance."""
LEAST_ABSENT = 0.1
"""Share of the subsets: where none is absent, light may still change within the window."""
LARGEST_ERROR = 0.09
"""Squared, relative to the mean's square: beyond, a pixel is gathered in full."""
LARGEST_ERROR_IN_SHADOW = 0.05
"""With visibility maps: where a VPL is seen from one pixel and not from the next, a window errs by more than
its subsets tell."""


class InterleavedFilterPass:
    """G-buffer, interleaved image → irradiance, and with `refine` the list of pixels it does not serve.

    With `relight`, the image comes with the directions of its light, and neighbours count as if they had a
    pixel's normal; `shadowed` tells that visibility maps took part. With `add_base`, another irradiance
    image is added to the result.
    """

    def __init__(
        self,
        context: moderngl.Context,
        interleave: int,
        *,
        refine: bool = False,
        relight: bool = False,
        shadowed: bool = False,
        add_base: bool = False,
    ):
        self._context = context
        defines = {
            **buffer_bindings.DEFINES,
            "INTERLEAVE": interleave,
            "PLANE_TOLERANCE": PLANE_TOLERANCE,
            "NORMAL_COSINE": NORMAL_COSINE,
            "LEAST_COSINE": LEAST_COSINE,
            "LARGEST_RELIGHTING": LARGEST_RELIGHTING,
            "LEAST_VARIANCE": LEAST_VARIANCE,
            "LEAST_ABSENT": LEAST_ABSENT,
            "LARGEST_ERROR": LARGEST_ERROR_IN_SHADOW if shadowed else LARGEST_ERROR,
            "RELIGHT": relight,
            "REFINE": refine,
            "ADD_BASE": add_base,
        }
        self._program = load_compute(context, "vpl_gather/interleaved_filter", defines)

    def draw(
        self,
        camera: CameraUniforms,
        gbuffer: GBuffer,
        interleaved: moderngl.Texture,
        irradiance: moderngl.Texture,
        *,
        direction: moderngl.Texture | None = None,
        pixel_list: PixelList | None = None,
        base: moderngl.Texture | None = None,
    ) -> None:
        """`pixel_list` is emptied and filled where the pass refines; `direction` is read where it relights,
        and `base` is added where it adds."""
        camera.bind_gbuffer(self._program, gbuffer, 0)
        interleaved.use(2)
        if base is not None:
            base.use(3)
        if direction is not None:
            direction.use(4)
        if pixel_list is not None:
            pixel_list.clear()
            pixel_list.bind()
        set_uniforms(self._program, interleaved=2, base=3, direction=4)
        irradiance.bind_to_image(0, read=False, write=True)
        self._program.run(-(-irradiance.width // 8), -(-irradiance.height // 8))
        context = self._context
        # The listed pixels are written once more; the next frame empties the list before it is filled.
        context.memory_barrier(
            context.TEXTURE_FETCH_BARRIER_BIT
            | context.SHADER_IMAGE_ACCESS_BARRIER_BIT
            | context.SHADER_STORAGE_BARRIER_BIT
            | context.COMMAND_BARRIER_BIT
            | context.BUFFER_UPDATE_BARRIER_BIT
        )
