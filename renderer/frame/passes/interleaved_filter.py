"""Geometry-aware reconstruction of interleaved images (Keller and Heidrich 2001; Segovia et al. 2006)."""

from collections.abc import Callable

from vpltune.renderer.frame.frame_pass import FrameInputs, FramePass
from vpltune.renderer.frame.irradiance_filter import LARGEST_ERROR, IrradianceFilter
from vpltune.renderer.gpu.render_targets import EMPTY_DISPATCH
from vpltune.renderer.gpu.resources import Resources

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
        self._filter = IrradianceFilter(
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
        self._filter = IrradianceFilter(
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
