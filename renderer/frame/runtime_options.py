"""What a program chooses of the runtime and an artist does not: how it computes, not what it shows."""

from dataclasses import dataclass
from typing import Literal, get_args

from vpltune.renderer.frame.point_table import PointTable

INTERLEAVES = (1, 2, 4, 8)
REFINEMENTS = (1, 2, 4, 8)
LightPath = Literal["auto", "volumes", "tiles"]
RsmFiltering = Literal[1, 3, 5, 9]


@dataclass(frozen=True)
class RuntimeOptions:
    """How the runtime works.

    Raises:
        ValueError: a field has a value that it cannot have.
    """

    interleave: int = 1
    """One of `INTERLEAVES`: pixels along the side of a block that shares the VPLs out among its pixels. 1
    gathers every VPL at every pixel, which is what the tuner's surrogate is a twin of; 4 is some ten times
    faster. Where there are fewer VPLs than pixels in a block, blocks are smaller."""

    light_path: LightPath = "auto"
    """How dynamic lights are drawn: as blended volumes, in tiles, or in whichever of the two is measured to
    be faster on this machine, when a frame first has that many lights."""

    point_table: PointTable = "r2"
    """From which VPLs are placed: the R2 sequence, or the study's Poisson discs, to compare with."""

    visibility_map_size: int = 24
    """Texels along the side of a VPL's visibility map, in [4, 64], where the config asks for maps."""

    visibility_map_refinement: int = 4
    """One of `REFINEMENTS`: rays along the side of a texel where a silhouette runs through it. With 4, maps
    are as good as four times their size, for 1.5 to 5 times the rays instead of 16."""

    rsm_filtering: RsmFiltering = 5
    """RSM texels along the side of the square whose mean light a VPL has, while it slides over its surface as
    the light moves. 1 takes one texel's light and place, which then change by jumps."""

    rsm_snapping: bool = True
    """Whether a directional light's RSM keeps its grid while bounds move: its size changes in steps, its
    place by whole texels. Otherwise it fits the bounds, and shadows and VPLs crawl with them."""

    adaptation_frames: float = 0.0
    """Time constant, in frames, over which the parameters of a config with a prior (`auto`) follow what is
    measured. 0 takes what each image asks for, as a still needs it; a clip or a game has 15, a quarter of a
    second, and then no parameter moves by more than `passes.auto_parameters.LARGEST_STEP` a frame."""

    def interleave_for(self, vpl_count: int) -> int:
        """The side of a block, as large as asked for where each of its pixels gets a VPL.

        Without, most pixels of a window are dark, and a window at the image's border that has none of the
        lit ones passes for unlit: one VPL shared among 64 pixels lost a tenth of its light.
        """
        return max(side for side in INTERLEAVES if side <= self.interleave and side**2 <= max(1, vpl_count))

    def __post_init__(self) -> None:
        if self.interleave not in INTERLEAVES:
            raise ValueError(f"interleave: must be one of {INTERLEAVES}, got {self.interleave!r}")
        if not 4 <= self.visibility_map_size <= 64:
            raise ValueError(f"visibility_map_size: must be in [4, 64], got {self.visibility_map_size!r}")
        if self.visibility_map_refinement not in REFINEMENTS:
            raise ValueError(
                f"visibility_map_refinement: must be one of {REFINEMENTS}, "
                f"got {self.visibility_map_refinement!r}"
            )
        if not 0.0 <= self.adaptation_frames <= 1e4:
            raise ValueError(f"adaptation_frames: must be in [0, 10000], got {self.adaptation_frames!r}")
        if self.light_path not in get_args(LightPath):
            raise ValueError(f"light_path: must be one of {get_args(LightPath)}, got {self.light_path!r}")
        if self.point_table not in get_args(PointTable):
            raise ValueError(f"point_table: must be one of {get_args(PointTable)}, got {self.point_table!r}")
        if self.rsm_filtering not in get_args(RsmFiltering):
            raise ValueError(
                f"rsm_filtering: must be one of {get_args(RsmFiltering)}, got {self.rsm_filtering!r}"
            )
