"""How much work goes into a frame while things move, so that the page follows the hand."""

from dataclasses import dataclass, replace

from vpltune.renderer.config.quality import SMALLEST_MAP
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.rsm_resolution import rsm_resolution
from vpltune.renderer.scene.scene import Light

MOVING_MILLISECONDS = 90.0
"""Time of a frame in motion that the effort is chosen for. A choice: ten frames a second feel direct."""
EASE = 0.5
"""The effort rises if the last frame took less than this share of the time. A choice: each step costs about
twice the one below, so that efforts do not alternate."""
FEWEST_VPLS = 32
"""VPLs that are left at the least effort. A choice: with fewer, the light in a room jumps."""


@dataclass(frozen=True)
class Effort:
    """What is left of a frame's work."""

    divisor: int
    """What the image's sides are divided by."""
    vpl_share: float
    """Share of the VPL count."""
    map_size: int
    """Most texels along the side of a visibility map."""
    rsm_resolution: int
    """Most texels along the side of an RSM face."""

    def size(self, full: tuple[int, int]) -> tuple[int, int]:
        """Width and height of an image that is `full` at rest."""
        return max(1, full[0] // self.divisor), max(1, full[1] // self.divisor)

    def config(self, config: TunedConfig, lights: tuple[Light, ...], full: tuple[int, int]) -> TunedConfig:
        """The config of a frame with this effort."""
        count = config.parameters.vpl_count
        left = max(min(count, FEWEST_VPLS), round(count * self.vpl_share))
        quality = replace(
            config.quality,
            # As in the full frame: small ones would be gathered pixel by pixel.
            interleave=config.quality.interleave_for(left, full),
            map_size=max(SMALLEST_MAP, min(config.quality.map_size, self.map_size)),
            rsm_resolution=min(rsm_resolution(lights, config.quality), self.rsm_resolution),
        )
        return replace(config, quality=quality, parameters=replace(config.parameters, vpl_count=left))


EFFORTS = (
    Effort(1, 1.0, 64, 8192),
    Effort(2, 1.0, 64, 8192),
    Effort(2, 1 / 2, 24, 1024),
    Effort(2, 1 / 4, 16, 512),
    Effort(2, 1 / 8, 16, 256),
    Effort(3, 1 / 16, 12, 256),
)
"""From a still's to the least. A choice: on llvmpipe, the last takes a tenth of the first's time."""
FIRST_EFFORT = 3
"""Where a page begins. A choice: it is right within a few frames."""


def next_effort(effort: int, milliseconds: float) -> int:
    """The index of the effort to draw with after a frame that took so long."""
    if milliseconds > MOVING_MILLISECONDS:
        # Far too slow: two steps at once.
        return min(effort + (2 if milliseconds > 4.0 * MOVING_MILLISECONDS else 1), len(EFFORTS) - 1)
    return max(effort - 1, 0) if milliseconds < EASE * MOVING_MILLISECONDS else effort
