"""VPL gather: indirect irradiance at every pixel in a compute shader, from every VPL or from its share."""

import moderngl

from vpltune.renderer.frame import vpl_disc_bounds
from vpltune.renderer.frame.visibility_map_layout import NO_MAPS, VisibilityMapLayout
from vpltune.renderer.gpu import buffer_bindings
from vpltune.renderer.gpu.camera_uniforms import CameraUniforms
from vpltune.renderer.gpu.render_targets import GBuffer, PixelList
from vpltune.renderer.gpu.shader_library import load_compute, set_uniforms


class VplGatherPass:
    """G-buffer, VPLs → indirect irradiance.

    `interleave` n: each pixel of an n×n block gathers from its own n²-th part of the VPLs, n² times as
    bright (Keller and Heidrich 2001). Such an image is for the interleaved filter; 1 is the full gather.
    `visibility`: the layout of the VPLs' visibility maps, which may be none.
    """

    def __init__(
        self, context: moderngl.Context, interleave: int = 1, visibility: VisibilityMapLayout = NO_MAPS
    ):
        self._context = context
        self._visibility = visibility
        self._interleave = interleave
        self._programs: dict[tuple[bool, bool], moderngl.ComputeShader] = {}

    def draw(
        self,
        camera: CameraUniforms,
        gbuffer: GBuffer,
        vpl_count: int,
        irradiance: moderngl.Texture,
        direction: moderngl.Texture | None = None,
        cells: bool = False,
    ) -> None:
        """Gather from the VPLs, with the parameters, that are bound.

        `direction` takes where the light comes from, in an interleaved image. `cells`: VPLs are cells of
        light, which shine as discs, and not points.
        """
        program = self._program(cells, listed_pixels=False)
        self._bind(program, camera, gbuffer, vpl_count, irradiance)
        if direction is not None:
            direction.bind_to_image(1, read=False, write=True)
        side = 8 * self._interleave
        groups = (-(-irradiance.width // side), -(-irradiance.height // side))
        program.run(*groups, self._interleave**2)
        self._context.memory_barrier(self._context.TEXTURE_FETCH_BARRIER_BIT)

    def refine(
        self,
        camera: CameraUniforms,
        gbuffer: GBuffer,
        vpl_count: int,
        pixel_list: PixelList,
        irradiance: moderngl.Texture,
        cells: bool = False,
    ) -> None:
        """Gather in full at the listed pixels of an interleaved image, and leave the others as they are."""
        assert self._interleave > 1, "a full gather has nothing to refine"
        program = self._program(cells, listed_pixels=True)
        self._bind(program, camera, gbuffer, vpl_count, irradiance)
        pixel_list.bind()
        program.run_indirect(pixel_list.buffer)
        self._context.memory_barrier(self._context.TEXTURE_FETCH_BARRIER_BIT)

    def _program(self, cells: bool, listed_pixels: bool) -> moderngl.ComputeShader:
        """Compiled when it is first needed: most configs need one form of VPL."""
        if (cells, listed_pixels) not in self._programs:
            defines = {
                **buffer_bindings.DEFINES,
                **vpl_disc_bounds.DEFINES,
                "INTERLEAVE": 1 if listed_pixels else self._interleave,
                "LISTED_PIXELS": listed_pixels,
                "VPL_DISCS": cells,
                **self._visibility.defines,
            }
            self._programs[cells, listed_pixels] = load_compute(
                self._context, "vpl_gather/vpl_gather", defines
            )
        return self._programs[cells, listed_pixels]

    def _bind(
        self,
        program: moderngl.ComputeShader,
        camera: CameraUniforms,
        gbuffer: GBuffer,
        vpl_count: int,
        irradiance: moderngl.Texture,
    ) -> None:
        camera.bind_gbuffer(program, gbuffer, 0)
        set_uniforms(program, vpl_count=vpl_count)
        irradiance.bind_to_image(0, read=False, write=True)
