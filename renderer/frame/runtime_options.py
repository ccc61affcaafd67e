"""Techniques that a program may choose between; a config says nothing of them."""

from dataclasses import dataclass
from typing import Literal, get_args

from vpltune.renderer.frame.point_table import PointTable
from vpltune.renderer.frame.vpl_pools import LATER_SHARE
from vpltune.renderer.frame.walk_samples import WALKS

LightPath = Literal["auto", "volumes", "tiles"]
RsmFiltering = Literal[1, 3, 5, 9]


@dataclass(frozen=True)
class RuntimeOptions:
    """How the runtime works.

    Raises:
        ValueError: a field has a value that it cannot have.
    """

    light_path: LightPath = "auto"
    """How dynamic lights are drawn: as blended volumes, in tiles, or in whichever of the two is measured to
    be faster on this machine, when a frame first has that many lights."""

    point_table: PointTable = "r2"
    """Where VPLs are placed from: the R2 sequence, or the Poisson discs of the 2010 study, for comparison."""

    rsm_filtering: RsmFiltering = 5
    """RSM texels along the side of the square whose mean light a VPL takes, while it slides over its surface
    as the light moves. 1 takes one texel's light and position, which then jump."""

    rsm_snapping: bool = True
    """Whether a directional light's RSM keeps its grid while bounds move: its size changes in steps, its
    position by whole texels. Otherwise it fits the bounds, and shadows and VPLs crawl with them."""

    walks: int = WALKS
    """Light walks of a frame, an even number: half of them may begin on glowing surfaces."""

    later_share: float = LATER_SHARE
    """VPLs of later light for each VPL that the config asks for, see `LATER_SHARE`."""

    def __post_init__(self) -> None:
        if self.light_path not in get_args(LightPath):
            raise ValueError(f"light_path: must be one of {get_args(LightPath)}, got {self.light_path!r}")
        if self.point_table not in get_args(PointTable):
            raise ValueError(f"point_table: must be one of {get_args(PointTable)}, got {self.point_table!r}")
        if self.rsm_filtering not in get_args(RsmFiltering):
            raise ValueError(
                f"rsm_filtering: must be one of {get_args(RsmFiltering)}, got {self.rsm_filtering!r}"
            )
        if self.walks < 2 or self.walks % 2:
            raise ValueError(f"walks: must be an even number, 2 or more, got {self.walks!r}")
        if not self.later_share > 0.0:
            raise ValueError(f"later_share: must be more than 0, got {self.later_share!r}")


DEFAULT_OPTIONS = RuntimeOptions()
