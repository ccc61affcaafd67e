"""What the GPU measures of a lit scene each frame, so that parameters can follow it: numbers without units.

Every statistic is a ratio in [0, 1], finite whatever the scene, and the same for the scene and its light
scaled together. Receivers are `RECEIVERS` pixels on an R2 sequence; VPLs are the first `VPLS` of the frame,
which are spread as evenly as all of them. A pair's weight is Φ·cosθ_x·cosθ_j/(d² + ℓ²): the light that would
arrive if nothing stood between. Twin: `tuner.surrogate.scene_statistics`.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Statistic:
    """One statistic: its name, and what it measures."""

    name: str
    meaning: str


STATISTICS: tuple[Statistic, ...] = (
    Statistic("visible", "share of its light that a receiver sees, the mean over receivers"),
    Statistic("visible_spread", "twice the standard deviation of that share over receivers"),
    Statistic(
        "near", "ℓ²/(d² + ℓ²), weighed by light, the mean over receivers: how near a footprint they are"
    ),
    Statistic("distance", "d/(d + L), weighed by light, the mean over receivers"),
    Statistic("facing", "share of pairs of receiver and VPL that face each other"),
    Statistic("evenness", "(ΣE)²/(n·ΣE²) of the light at receivers: 1 where all get the same"),
    Statistic("roundness", "27·det C/(tr C)³ of the covariance of lit places: 1 for a ball, 0 for a plane"),
    Statistic("flatness", "3·(sum of principal minors)/(tr C)²: 1 for a ball, 3/4 for a disc, 0 for a line"),
    Statistic("coherence", "|ΣΦn|/ΣΦ of the lit places' normals: 1 for one plane, 0 all round"),
    Statistic("concavity", "cosθ_i·cosθ_j between pairs of lit places: how much they shine on each other"),
    Statistic("footprint", "ℓ/(ℓ + L), the mean over VPLs"),
    Statistic("vpl_count", "log₂ N / 16"),
)

STATISTIC_NAMES = tuple(statistic.name for statistic in STATISTICS)

RECEIVERS = 1024
"""Pixels that statistics are measured at. A choice."""
VPLS = 128
"""VPLs that pairs are made with. A choice."""
STRIDE = 4
"""A receiver is paired with every fourth of them. A choice."""
MOMENT_VPLS = 256
"""VPLs that stand for the lit places."""
PARTNERS = 8
"""Lit places that each is compared with, for concavity: the next in the sequence, which lie far off."""
