"""VPL gather: irradiance at every pixel, from every VPL or from the pixel's share of them."""

from collections.abc import Sequence

from vpltune.renderer.frame import vpl_disc_bounds
from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.visibility_map_layout import MAP_READS, VisibilityMapLayout
from vpltune.renderer.frame.vpl_pools import VplPools
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import GBUFFER_READS
from vpltune.renderer.gpu.resources import Resources

GATHER_READS = (
    *GBUFFER_READS, "artist_parameters", "frame_statistics", "virtual_point_lights", "pixel_list"
)  # fmt: skip
_GROUP_SIDE = 8
"""Pixels along the side of a workgroup."""


class VplGatherPass(FramePass):
    """G-buffer, VPLs of reflected light, visibility maps → `vpl_irradiance`.

    With `interleave` n > 1, each pixel of an n×n block gathers from its own n²-th part of the VPLs, n² times
    as bright (Keller and Heidrich 2001), into `shared_irradiance` and `shared_direction`, for the filter.
    """

    name = "vpl_gather"

    def __init__(self, resources: Resources, interleave: int, maps: VisibilityMapLayout, pools: VplPools):
        self._resources = resources
        self._interleave = interleave
        writes = ("vpl_irradiance as irradiance",)
        if interleave > 1:
            writes = ("shared_irradiance as irradiance", "shared_direction as direction")
        self._program = _GatherProgram(resources, maps, interleave, _reflected(pools), writes)

    def draw(self, inputs: FrameInputs) -> None:
        """Gather at every pixel."""
        target = self._resources.texture("vpl_irradiance")
        side = _GROUP_SIDE * self._interleave
        groups = (-(-target.width // side), -(-target.height // side), self._interleave**2)
        self._program.of(inputs).dispatch(*groups, **self._program.uniforms(inputs))


class GatherListedPixelsPass(FramePass):
    """The full gather at the pixels that the interleaved filter has listed; others stay as they are."""

    name = "vpl_gather"

    def __init__(self, resources: Resources, maps: VisibilityMapLayout, pools: VplPools):
        writes = ("vpl_irradiance as irradiance",)
        self._program = _GatherProgram(resources, maps, 1, _reflected(pools), writes, listed_pixels=True)

    def draw(self, inputs: FrameInputs) -> None:
        """Gather at the listed pixels."""
        self._program.of(inputs).dispatch_indirect("pixel_list", **self._program.uniforms(inputs))


class GatherGlowingPass(FramePass):
    """G-buffer, VPLs on glowing surfaces, visibility maps, `punctual_irradiance` → `direct_irradiance`."""

    name = "gather_glowing"

    def __init__(self, resources: Resources, maps: VisibilityMapLayout, pools: VplPools):
        self._resources = resources
        writes = ("direct_irradiance as irradiance",)
        ranges = ((pools.reflected, pools.glowing),)
        self._program = _GatherProgram(resources, maps, 1, ranges, writes, glowing=True)

    def draw(self, inputs: FrameInputs) -> None:
        """Gather at every pixel."""
        target = self._resources.texture("direct_irradiance")
        groups = (-(-target.width // _GROUP_SIDE), -(-target.height // _GROUP_SIDE))
        self._program.of(inputs).dispatch(*groups, **self._program.uniforms(inputs))


def _reflected(pools: VplPools) -> tuple[tuple[int, int], ...]:
    """First VPL and number of each range that the reflected light comes from."""
    return ((0, pools.first), (pools.first, pools.later)) if pools.later else ((0, pools.first),)


class _GatherProgram:
    """The gather's program for points or discs, compiled when it is first needed."""

    def __init__(
        self,
        resources: Resources,
        maps: VisibilityMapLayout,
        interleave: int,
        ranges: tuple[tuple[int, int], ...],
        writes: Sequence[str],
        *,
        listed_pixels: bool = False,
        glowing: bool = False,
    ):
        self._resources = resources
        self._writes = writes
        self._ranges = ranges
        self._glowing = glowing
        added = ("punctual_irradiance as added_irradiance",) if glowing else ()
        self._reads = (*GATHER_READS, *(MAP_READS if maps.size else ()), *added)
        self._defines = {
            **vpl_disc_bounds.DEFINES,
            **maps.defines,
            "VPL_RANGES": len(ranges),
            "GLOWING": glowing,
            "INTERLEAVE": interleave,
            "LISTED_PIXELS": listed_pixels,
        }
        self._programs: dict[bool, ComputeProgram] = {}

    def of(self, inputs: FrameInputs) -> ComputeProgram:
        """The program for the VPLs of this drawing."""
        discs = inputs.parameters.vpls_are_discs or self._glowing
        if discs not in self._programs:
            self._programs[discs] = ComputeProgram(
                self._resources,
                "vpl_gather/vpl_gather",
                {**self._defines, "VPL_DISCS": discs},
                reads=self._reads,
                writes=self._writes,
            )
        return self._programs[discs]

    def uniforms(self, inputs: FrameInputs) -> dict[str, object]:
        """What the program is dispatched with."""
        ranges = self._ranges[0] if len(self._ranges) == 1 else list(self._ranges)
        return {**inputs.camera.uniforms, "vpl_ranges": ranges}
