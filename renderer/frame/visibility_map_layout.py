"""How VPL visibility maps are laid out: what the passes that cast them and those that read them agree on."""

from dataclasses import dataclass

from vpltune.renderer.config.tuned_config import TunedConfig

TEXEL_BYTES = 8
"""A distance and a packed normal, or the place of finer texels: shaders/common/vpl_visibility.glsl."""
VISIBILITY_LIFT = 0.01
"""Rays start, and distances count, from a point lifted off the VPL's surface by this many footprints. A VPL
behind its own surface would see nothing else, and the RSM is off: by 1/256 of a texel, in which a rasteriser
counts places, and by the rounding of its depth. A footprint is tens of texels."""
VISIBILITY_CORNER_MASK = 7
"""Bits at the end of a map's distances that hold the corner mark (shaders/common/vpl_visibility.glsl). They
change a distance by 1e-6 of itself."""
VISIBILITY_NEAREST_VERTEX = 1
"""The mark of a texel that a concave corner of two surfaces may run through: a receiver's three neighbouring
texels are those nearest to its direction."""
VISIBILITY_FIRST_VERTEX = 2
"""The first of four marks of a texel near a vertex of three surfaces: its neighbours are those across the
texel's corner number mark - 2, the same for every receiver."""
VISIBILITY_ROUNDING = 1e-4
"""Rounding of positions and of 16-bit normals moves a point by less than this share of the distance. A
choice."""
SHEET_COSINE = -0.7
"""A choice, as the next two. A receiver is taken to be on the other side of the sheet that a ray hit if the
normals are at more than 134° (`shows_its_back` in shaders/common/vpl_visibility.glsl)."""
SHEET_BEND = 0.3
"""The receiver is within 17° of the hit's plane: facets of a lampshade of 24 sides are at 15°."""
SHEET_TILT = 0.5
"""The hit is within 30° of the plane of the receiver's shading normal, which is between those of facets."""
FEW_LOOKED_UP = 8
"""Where receivers may look up at most so many texels of a map, all that the camera sees is a few texels wide
to the VPL, and may lie between two rays. Each of these texels is cast finer. A choice: 128 rays at most."""
FRAME_TURNS_OVER = -0.5
"""The z of a normal below which a map's tangents turn over. Not 0, where walls have their normals and
rounding would decide."""
_MOST_DETAIL_BYTES = 1 << 27
"""Bytes that every driver takes in one storage buffer: with blocks of 4², about 10,000 default maps of a
room."""


@dataclass(frozen=True)
class VisibilityMapLayout:
    """Texels along the side of a map, and of the block that stands for one of them at a silhouette.

    A `size` of 0 is no map at all; a `refinement` of 1 is texels of one size everywhere.
    """

    size: int
    refinement: int

    @classmethod
    def of(cls, config: TunedConfig) -> "VisibilityMapLayout":
        """The layout that a config asks for."""
        if config.visibility != "maps":
            return NO_MAPS
        return cls(config.quality.map_size, config.quality.map_refinement)

    @property
    def defines(self) -> dict[str, int | float | str]:
        """What a shader that includes `common/vpl_visibility.glsl` is compiled with."""
        return {
            "VISIBILITY_MAP_SIZE": self.size,
            "VISIBILITY_MAP_REFINEMENT": self.refinement,
            "VISIBILITY_LIFT": VISIBILITY_LIFT,
            "VISIBILITY_CORNER_MASK": f"{VISIBILITY_CORNER_MASK}u",
            "VISIBILITY_NEAREST_VERTEX": f"{VISIBILITY_NEAREST_VERTEX}u",
            "VISIBILITY_FIRST_VERTEX": f"{VISIBILITY_FIRST_VERTEX}u",
            "VISIBILITY_ROUNDING": VISIBILITY_ROUNDING,
            "VISIBILITY_SHEET_COSINE": SHEET_COSINE,
            "VISIBILITY_SHEET_BEND": SHEET_BEND,
            "VISIBILITY_SHEET_TILT": SHEET_TILT,
            "FEW_LOOKED_UP": FEW_LOOKED_UP,
            "FRAME_TURNS_OVER": FRAME_TURNS_OVER,
        }

    def blocks(self, vpl_count: int) -> int:
        """Blocks of finer texels that there is room for: one for every texel of 1,024 default maps.

        Where they run out, texels stay coarse, and which ones may differ from frame to frame.
        """
        if self.refinement == 1:
            return 0
        most = _MOST_DETAIL_BYTES // (self.refinement**2 * TEXEL_BYTES)
        return min(vpl_count * self.size**2, most)


NO_MAPS = VisibilityMapLayout(0, 1)
MAP_READS = ("visibility_maps", "visibility_details")
"""What a program declares that includes `common/vpl_visibility.glsl`."""
