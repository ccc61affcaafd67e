"""How the VPLs of a frame are shared out: by where their light comes from."""

from dataclasses import dataclass

from vpltune.renderer.config.artist_parameters import LARGEST_DISC_COUNT
from vpltune.renderer.frame.disc_samples import SAMPLES_OF_DISC, sample_count
from vpltune.renderer.frame.walk_samples import WALKS, recorded_steps

VPL_BYTES = 48
"""Bytes of a VPL: `shaders/common/virtual_point_lights.glsl`."""
LATER_SHARE = 0.5
"""VPLs of light that was reflected more than once, or came from glowing surfaces, for each VPL of light that
was reflected once and came from lamps or sky. A choice of 0.25, 0.5 and 1: in eight generated rooms the mean
relMSE is 0.0035, 0.0034 and 0.0028 (`python -m benchmarks.quality.all_bounces`), the darkest has 0.960, 0.972
and 0.978 of its light, and the time of maps and gather grows with the number of VPLs."""
GLOWING_SHARE = 0.5
"""VPLs on glowing surfaces for each of the first kind. A choice."""


@dataclass(frozen=True)
class VplPools:
    """How many VPLs there are of each kind. They lie in this order in `virtual_point_lights`."""

    first: int
    """Drawn from the RSM: light of lamps and sky that was reflected once."""
    later: int = 0
    """Drawn from light walks: light that was reflected more often, or came from glowing surfaces."""
    glowing: int = 0
    """On glowing surfaces: light that was not reflected."""

    @classmethod
    def of(
        cls,
        count: int,
        *,
        has_lights: bool,
        glows: bool,
        bounces: int | None,
        walks: int = WALKS,
        later_share: float = LATER_SHARE,
    ) -> "VplPools":
        """The pools of a config with `count` VPLs.

        Args:
            count: VPLs that the config asks for.
            has_lights: whether the view has a light with an RSM.
            glows: whether a surface glows.
            bounces: reflections before light reaches the receiver; None for all.
            walks: light walks of a frame.
            later_share: see `LATER_SHARE`.
        """
        # A disc of a single sample has no more than that sample's own guess of an area.
        samples = walks * recorded_steps(bounces, has_lamps=has_lights, glows=glows)
        most = min(LARGEST_DISC_COUNT, samples // SAMPLES_OF_DISC)
        if not has_lights and not glows:
            return cls(count)
        later = min(most, max(1, round(later_share * count)))
        if not glows:
            return cls(count, later)
        glowing = _share(GLOWING_SHARE, count)
        # One VPL stays where there is no lamp: a buffer cannot be empty. It has no flux.
        return cls(count, later, glowing) if has_lights else cls(1, min(most, count), glowing)

    @property
    def asked(self) -> int:
        """VPLs that the config's count asks for: the first pool, or without lamps that of later light."""
        return max(self.first, self.later)

    @property
    def reflected(self) -> int:
        """VPLs of light that was reflected, once or more."""
        return self.first + self.later

    @property
    def total(self) -> int:
        """All VPLs of a frame."""
        return self.reflected + self.glowing


@dataclass(frozen=True)
class DiscPool:
    """The names and sizes of what one pool's discs are clustered from and into."""

    name: str
    """Begins the names of its buffers: `NAME_samples`, `NAME_members`, `NAME_vpls`."""
    vpl_count: int
    sample_count: int
    starts: str
    """The buffer of the samples that the discs start at, one for each."""

    @classmethod
    def first(cls, vpl_count: int) -> "DiscPool":
        """The pool of `VplPools.first`."""
        return cls("first", vpl_count, sample_count(vpl_count), "first_samples")

    @classmethod
    def glowing(cls, vpl_count: int) -> "DiscPool":
        """The pool of `VplPools.glowing`."""
        return cls("glowing", vpl_count, sample_count(vpl_count), "glowing_samples")

    @classmethod
    def later(cls, vpl_count: int, samples: int) -> "DiscPool":
        """The pool of `VplPools.later`, clustered from so many samples; discs start at lit ones."""
        return cls("later", vpl_count, samples, "later_starts")

    @property
    def vpls(self) -> str:
        """The buffer of the pool's VPLs."""
        return f"{self.name}_vpls"

    @property
    def samples(self) -> str:
        """The buffer of their samples."""
        return f"{self.name}_samples"

    @property
    def members(self) -> str:
        """The buffer that says which samples belong to which disc."""
        return f"{self.name}_members"


def _share(share: float, count: int) -> int:
    return min(LARGEST_DISC_COUNT, max(1, round(share * count)))
