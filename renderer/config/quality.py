"""The quality part of a config: settings that trade image quality for frame time.

`vpltune fit --budget-ms` finds them, and every command draws with them unless a flag overrides one.
"""

from dataclasses import asdict, dataclass
from typing import Any, Literal

from vpltune.renderer.config.member_rules import (
    check_number,
    check_one_of,
    check_whole,
    known_members,
    whole_as_int,
)
from vpltune.renderer.errors import InputError

INTERLEAVES = (1, 2, 4, 8)
"""Sides of a block. A choice: 8² pixels are one workgroup of the gather."""
AUTO_INTERLEAVE = {1: 0, 2: 320 * 180, 4: 640 * 360}
"""Pixels of a frame from which `auto` takes blocks of each side: the smallest frames of those measured at
which the side adds less than a tenth to the error (docs/design_decisions.md). Side 8 adds more, and its
filter takes the time that its gather saves."""
MAP_REFINEMENTS = (1, 2, 4, 8)
"""Rays along the side of a refined texel. A choice."""
SMALLEST_MAP, LARGEST_MAP = 4, 64
"""Texels along the side of a map. The largest map fills the 32 KiB of shared memory that every driver has."""
SMALLEST_RSM, LARGEST_RSM = 64, 8192
"""Texels along the side of a face. A choice: six faces of the largest need 2 GiB."""
LONGEST_ADAPTATION = 1e4
"""Frames: nearly three minutes at 60 frames per second, far beyond any use."""
LARGEST_SIDE = 16384
"""Pixels along the side of a frame; also the rule of `views.json`."""


@dataclass(frozen=True)
class MetBudget:
    """The frame-time budget that the settings were chosen for, and where they were measured to meet it."""

    milliseconds: float
    frame_size: tuple[int, int]
    """Width and height of the timed frames, in pixels."""
    machine: str
    """The OpenGL renderer's name."""


@dataclass(frozen=True)
class Quality:
    """How much work a frame does.

    Raises:
        InputError: a field is out of range.
    """

    interleave: int | Literal["auto"] = "auto"
    """One of `INTERLEAVES`: the VPLs are shared out among the pixels of a block of this side, and a filter
    joins them. 1 gathers every VPL at every pixel, as the tuner's surrogate does. `auto` follows the frame's
    size by `AUTO_INTERLEAVE`. With fewer VPLs than pixels in a block, blocks are smaller."""

    map_size: int = 32
    """Texels along the side of a VPL's visibility map, in [4, 64]."""

    map_refinement: int = 4
    """One of `MAP_REFINEMENTS`: rays along the side of a map texel that a silhouette crosses."""

    rsm_resolution: int | None = None
    """Texels along the side of an RSM face, in [64, 8192]; None picks 1,024, or 512 with more than two faces
    (a point light has six)."""

    adaptation_frames: float = 15.0
    """Time constant, in frames, at which a clip's parameters follow the prior of an `auto` config: a quarter
    of a second at 60 frames per second. 0 follows at once. A still always does."""

    budget: MetBudget | None = None

    def __post_init__(self) -> None:
        self.check("quality")

    def check(self, where: str) -> None:
        """Raise InputError, naming `where`, if a field is out of range."""
        if self.interleave != "auto":
            check_one_of(self.interleave, INTERLEAVES, f"{where}.interleave", "auto")
        check_whole(self.map_size, SMALLEST_MAP, LARGEST_MAP, f"{where}.map_size")
        check_one_of(self.map_refinement, MAP_REFINEMENTS, f"{where}.map_refinement")
        if self.rsm_resolution is not None:
            check_whole(self.rsm_resolution, SMALLEST_RSM, LARGEST_RSM, f"{where}.rsm_resolution")
        check_number(self.adaptation_frames, 0.0, LONGEST_ADAPTATION, f"{where}.adaptation_frames")

    def interleave_for(self, vpl_count: int, frame_size: tuple[int, int]) -> int:
        """The side of a block: `interleave`, or less where a block would have more pixels than VPLs.

        `frame_size` is width and height in pixels.

        A pixel without a VPL of its own stays dark, and at the image's border a window of such pixels passes
        for unlit: one VPL shared among 64 pixels lost a tenth of its light.
        """
        width, height = frame_size
        most = self.interleave
        if most == "auto":
            most = max(side for side, pixels in AUTO_INTERLEAVE.items() if pixels <= width * height)
        return max(side for side in INTERLEAVES if side <= most and side**2 <= max(1, vpl_count))

    def as_dict(self) -> dict[str, Any]:
        """The part as the file holds it; what is None is left out."""
        members = {name: value for name, value in asdict(self).items() if value is not None}
        if self.budget is not None:
            members["budget"]["frame_size"] = list(self.budget.frame_size)
        return members

    @classmethod
    def validated(cls, values: Any, where: str, others: tuple[str, ...] = ()) -> "Quality":
        """The part from a file's content; keys that are absent have their defaults.

        Args:
            values: the object without the members that others read.
            where: names it in errors.
            others: names of those members, for the list of known keys.

        Raises:
            InputError: not an object, an unknown key, or a value out of range.
        """
        members = known_members(values, (*cls.__dataclass_fields__, *others), where)
        for name in ("interleave", "map_size", "map_refinement", "rsm_resolution"):
            if name in members:
                members[name] = whole_as_int(members[name])
        if "rsm_resolution" in members:
            check_whole(members["rsm_resolution"], SMALLEST_RSM, LARGEST_RSM, f"{where}.rsm_resolution")
        if "budget" in members:
            members["budget"] = _budget(members["budget"], f"{where}.budget")
        # Checked before the object exists, so that the error names the file.
        unchecked = object.__new__(cls)
        for name, spec in cls.__dataclass_fields__.items():
            object.__setattr__(unchecked, name, members.get(name, spec.default))
        unchecked.check(where)
        # As a float: programs write a whole one as 15 or as 15.0, and a checksum is of values.
        return cls(**{**members, "adaptation_frames": float(unchecked.adaptation_frames)})


def quality_schema(lloyd_iterations: dict[str, Any]) -> dict[str, Any]:
    """JSON Schema of the key `quality`; `lloyd_iterations` is that member's own schema."""
    side = {"type": "integer", "minimum": 1, "maximum": LARGEST_SIDE}
    default = Quality()
    return {
        "description": "Settings that trade image quality for frame time.",
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "interleave": {"enum": ["auto", *INTERLEAVES], "default": default.interleave},
            "map_size": {
                "type": "integer",
                "minimum": SMALLEST_MAP,
                "maximum": LARGEST_MAP,
                "default": default.map_size,
            },
            "map_refinement": {"enum": list(MAP_REFINEMENTS), "default": default.map_refinement},
            "rsm_resolution": {"type": "integer", "minimum": SMALLEST_RSM, "maximum": LARGEST_RSM},
            "lloyd_iterations": lloyd_iterations,
            "adaptation_frames": {
                "type": "number",
                "minimum": 0.0,
                "maximum": LONGEST_ADAPTATION,
                "not": {"exclusiveMaximum": 0.0},
                "default": default.adaptation_frames,
            },
            "budget": {
                "description": "The frame-time budget that was met, at which frame size and on what machine.",
                "type": "object",
                "required": ["milliseconds", "frame_size", "machine"],
                "additionalProperties": False,
                "properties": {
                    "milliseconds": {
                        "type": "number",
                        "exclusiveMinimum": 0.0,
                        "maximum": 1e9,
                        "not": {"maximum": 0.0},
                    },
                    "frame_size": {"type": "array", "items": side, "minItems": 2, "maxItems": 2},
                    "machine": {"type": "string"},
                },
            },
        },
    }


def _budget(values: Any, where: str) -> MetBudget:
    names = ("milliseconds", "frame_size", "machine")
    members = known_members(values, names, where)
    for name in names:
        if name not in members:
            raise InputError(f"{where}: key '{name}' is missing")
    milliseconds, size, machine = (members[name] for name in names)
    check_number(milliseconds, 0.0, 1e9, f"{where}.milliseconds")
    if not milliseconds > 0.0:
        raise InputError(f"{where}.milliseconds: must be positive, got {milliseconds!r}")
    if not isinstance(size, list) or len(size) != 2:
        raise InputError(f"{where}.frame_size: must be [width, height], got {size!r:.60}")
    size = [whole_as_int(side) for side in size]
    for side in size:
        check_whole(side, 1, LARGEST_SIDE, f"{where}.frame_size")
    if not isinstance(machine, str):
        raise InputError(f"{where}.machine: must be a string, got {machine!r:.60}")
    return MetBudget(float(milliseconds), (size[0], size[1]), machine)
