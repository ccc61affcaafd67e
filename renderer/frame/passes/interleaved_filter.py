"""Geometry-aware reconstruction of interleaved images (Keller and Heidrich 2001; Segovia et al. 2006)."""

from collections.abc import Callable

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.gpu.gpu_program import ComputeProgram
from vpltune.renderer.gpu.render_targets import EMPTY_DISPATCH, GBUFFER_READS, pixel_groups
from vpltune.renderer.gpu.resources import Resources

PLANE_TOLERANCE = 0.5
"""Pixel footprints that a neighbour may stand off a pixel's plane and still be on its surface. With 1, a dark
slot one pixel high over a lamp was as bright as the ceiling."""
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


class InterleavedFilterPass(FramePass):
    """G-buffer, `shared_irradiance`, `shared_direction` → `vpl_irradiance`, and the list of pixels that need
    a full gather.

    Neighbours count as if they had a pixel's normal. `shadowed` tells that visibility maps took part.
    """

    name = "interleaved_filter"

    def __init__(self, resources: Resources, interleave: int, *, shadowed: bool):
        self._resources = resources
        self._filter = _Filter(
            resources,
            interleave,
            reads=("shared_irradiance as interleaved", "shared_direction as direction"),
            target="vpl_irradiance",
            relight=True,
            refine=True,
            largest_error=LARGEST_ERROR_IN_SHADOW if shadowed else LARGEST_ERROR,
        )

    def draw(self, inputs: FrameInputs) -> None:
        """Join the neighbours' shares."""
        self._resources.write("pixel_list", EMPTY_DISPATCH)
        self._filter.draw(inputs)


class NearFieldFilterPass(FramePass):
    """G-buffer, `shared_irradiance`, `vpl_irradiance` → `near_field_irradiance`, their sum."""

    name = "screen_space_filter"

    def __init__(self, resources: Resources, block: int, wanted: Callable[[FrameInputs], bool]):
        self._near_field_wanted = wanted
        self._filter = _Filter(
            resources,
            block,
            reads=("shared_irradiance as interleaved", "vpl_irradiance as base"),
            target="near_field_irradiance",
            add_base=True,
        )

    def wanted(self, inputs: FrameInputs) -> bool:
        """Where there is a near field to filter."""
        return self._near_field_wanted(inputs)

    def draw(self, inputs: FrameInputs) -> None:
        """Join the neighbours' shares."""
        self._filter.draw(inputs)


class _Filter:
    def __init__(
        self,
        resources: Resources,
        interleave: int,
        *,
        reads: tuple[str, ...],
        target: str,
        relight: bool = False,
        refine: bool = False,
        add_base: bool = False,
        largest_error: float = LARGEST_ERROR,
    ):
        self._groups = pixel_groups(resources.texture(target))
        self._program = ComputeProgram(
            resources,
            "vpl_gather/interleaved_filter",
            {
                "INTERLEAVE": interleave,
                "PLANE_TOLERANCE": PLANE_TOLERANCE,
                "NORMAL_COSINE": NORMAL_COSINE,
                "LEAST_COSINE": LEAST_COSINE,
                "LARGEST_RELIGHTING": LARGEST_RELIGHTING,
                "LEAST_VARIANCE": LEAST_VARIANCE,
                "LEAST_ABSENT": LEAST_ABSENT,
                "LARGEST_ERROR": largest_error,
                "RELIGHT": relight,
                "REFINE": refine,
                "ADD_BASE": add_base,
            },
            reads=(*GBUFFER_READS, *reads),
            writes=(f"{target} as irradiance", "pixel_list"),
        )

    def draw(self, inputs: FrameInputs) -> None:
        self._program.dispatch(*self._groups, **inputs.camera.uniforms)
