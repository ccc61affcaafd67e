"""Whether a frame-time budget can be met at all: looked at before references and fit, which take minutes."""

from dataclasses import replace

from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.views import View
from vpltune.tuner.fitting.fit_density import with_discs
from vpltune.tuner.frame_time.cost_model import INTERLEAVES, MAP_SIZES, rsm_resolutions

FRAMES = 3
"""Frames of the timing, of which the median is taken. A choice."""
BEYOND_DOUBT = 1.25
"""A budget is refused where the fastest frame takes so many times as long. A choice: other load may slow
three frames down by less, and the fit itself settles closer calls."""


def require_possible_budget(
    runtime: Runtime, view: View, start: TunedConfig, budget: float, least_count: int
) -> None:
    """Draw `view` with the fastest settings that a budget may choose.

    Args:
        runtime: draws the scene.
        view: a fitted view at the size of the timed frames.
        start: where the fit begins.
        budget: milliseconds.
        least_count: least VPLs for each pixel of a block.

    Raises:
        InputError: the frame takes longer than the budget, beyond doubt.
        MachineError: the GPU ran out of memory or reported an error.
    """
    least = float("inf")
    for interleave in INTERLEAVES:
        parameters = replace(with_discs(start.parameters), vpl_count=least_count * interleave**2)
        quality = replace(
            start.quality,
            interleave=interleave,
            map_size=min(MAP_SIZES),
            rsm_resolution=rsm_resolutions(view)[-1],
        )
        config = replace(start, parameters=parameters, quality=quality, auto=None)
        least = min(least, runtime.frame_milliseconds(view, config, FRAMES))
        if least <= BEYOND_DOUBT * budget:
            return
    width, height = view.size
    raise InputError(
        f"--budget-ms: must be at least {least:.3g} on this machine for frames of {width}x{height}, "
        f"got {budget:g}"
    )
