"""The one table of what an artist can turn: name, symbol, range, unit, meaning.

The optimiser's bounds, the config reader and its schema, the exported shader constants and the
documentation all come from `ARTIST_PARAMETERS`. None of the parameters has a world unit, so one
set of values serves a scene at any scale.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal

from vpltune.renderer.errors import InputError

Scale = Literal["linear", "log"]
Part = Literal["parameters", "quality"]


@dataclass(frozen=True)
class ParameterSpec:
    """One row of the table.

    Raises:
        ValueError: low < high, low ≤ default ≤ high, or (log scale) low > 0 does not hold, a bound
            is not finite, or a whole-number parameter has a fractional bound or default.
    """

    name: str
    symbol: str
    """As written in ARCHITECTURE.md and in the literature."""
    default: float | int
    low: float | int
    """Smallest allowed value, itself allowed."""
    high: float | int
    """Largest allowed value, itself allowed."""
    scale: Scale
    """The scale on which a slider or an optimiser takes equal steps."""
    unit: str
    meaning: str
    fitted: bool
    """Whether `vpltune fit` adjusts it."""
    whole_number: bool = False
    part: Part = "parameters"
    """The part of a config file that holds it."""

    def __post_init__(self) -> None:
        numbers = (self.low, self.default, self.high)
        if not all(math.isfinite(number) for number in numbers):
            raise ValueError(f"{self.name}: low, default and high must be finite, got {numbers}")
        if not self.low < self.high:
            raise ValueError(f"{self.name}: low must be less than high, got {self.low} and {self.high}")
        if not self.low <= self.default <= self.high:
            raise ValueError(
                f"{self.name}: default must lie in [{self.low}, {self.high}], got {self.default}"
            )
        if self.scale == "log" and not self.low > 0.0:
            raise ValueError(f"{self.name}: low must be positive on a log scale, got {self.low}")
        if self.whole_number and any(number != round(number) for number in numbers):
            raise ValueError(f"{self.name}: low, default and high must be whole numbers, got {numbers}")

    def checked(self, value: Any, where: str = "parameters") -> float | int:
        """`value` as a float, or as an int where the parameter is a whole number.

        Raises:
            InputError: not a number, not finite, out of range, or a fraction where none may be.
        """
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{where}.{self.name}: must be a number, got {value!r:.60}")
        kind = "a whole number" if self.whole_number else "a number"
        # The comparison is false for NaN, and is made before float(), which overflows on 10**400.
        if not self.low <= value <= self.high:
            raise InputError(
                f"{where}.{self.name}: must be {kind} from {self.low:g} to {self.high:g}, got {value!r:.60}"
            )
        if not self.whole_number:
            return float(value)
        if value != round(value):
            raise InputError(f"{where}.{self.name}: must be a whole number, got {value!r:.60}")
        return int(value)

    def value_at(self, place: Any) -> Any:
        """The value at `place` in [0, 1] along the axis; for numbers, NumPy and JAX arrays alike."""
        if self.scale == "log":
            return self.low * (self.high / self.low) ** place
        return self.low + place * (self.high - self.low)

    def within(self, place: float) -> float:
        """`value_at`, clamped to the range: rounding may step over a bound, and readers are strict."""
        return float(min(max(self.value_at(place), self.low), self.high))

    def place_of(self, value: float | int) -> float:
        """Where along the axis, in [0, 1], the parameter has `value`."""
        if self.scale == "log":
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)


ARTIST_PARAMETERS: tuple[ParameterSpec, ...] = (
    ParameterSpec(
        name="intensity",
        symbol="k",
        default=1.0,
        low=0.05,
        high=20.0,
        scale="log",
        unit="1",
        meaning="scales all VPLs; its distance from 1 shows missing bounces or missing visibility",
        fitted=True,
    ),
    ParameterSpec(
        name="falloff_footprint",
        symbol="α",
        # A disc is as wide as its cluster. Points do best at about half of that, between 1, which is exact
        # facing a disc, and 0, which is so in the edge of a corner (`vpltune bench falloff_default`).
        default=1.0,
        low=0.05,
        high=20.0,
        scale="log",
        unit="VPL footprints",
        meaning="radius of a clustered disc, 1 its own; softens 1/d² near a point, as 1/(d² + (αℓ)²)",
        fitted=True,
    ),
    ParameterSpec(
        name="extinction_coefficient",
        symbol="κ",
        default=0.0,
        low=0.0,
        high=8.0,
        scale="linear",
        unit="1/L",
        meaning="mean transmittance exp(−κ·d/L), which stands in for unseen occluders",
        fitted=True,
    ),
    ParameterSpec(
        name="visibility_bias",
        symbol="β",
        default=0.0005,
        low=0.0001,
        high=0.1,
        scale="log",
        unit="of the distance",
        meaning="how far surfaces may overlap before one shades the other, where VPLs have visibility maps",
        fitted=True,
    ),
    ParameterSpec(
        name="visibility_softness",
        symbol="σ",
        default=0.001,
        low=0.0005,
        high=0.5,
        scale="log",
        unit="of the distance",
        meaning="over which share of the distance light then fades out",
        fitted=True,
    ),
    ParameterSpec(
        name="vpl_count",
        symbol="N",
        default=512,
        low=1,
        high=65536,
        scale="log",
        unit="VPLs",
        meaning="how many VPLs are drawn: cost against noise",
        fitted=False,
        whole_number=True,
    ),
    ParameterSpec(
        name="density_exponent",
        symbol="γ",
        default=1.0,
        low=0.0,
        high=1.0,
        scale="linear",
        unit="exponent",
        meaning="where VPLs are drawn: 0 uniformly over texels, 1 in proportion to their flux",
        fitted=False,
    ),
    ParameterSpec(
        name="density_importance",
        symbol="η",
        default=0.5,
        low=0.0,
        high=1.0,
        scale="linear",
        unit="share",
        meaning="share of the VPLs that go where the camera would miss them; flux alone places the rest",
        fitted=False,
    ),
    ParameterSpec(
        name="lloyd_iterations",
        symbol="λ",
        default=2,
        low=0,
        high=16,
        scale="linear",
        unit="iterations",
        meaning=(
            "Lloyd iterations that cluster the VPLs: 0 draws them as points, else each is a clustered disc "
            "light; more than 4,096 VPLs are always points"
        ),
        part="quality",
        fitted=False,
        whole_number=True,
    ),
    ParameterSpec(
        name="screen_space_radius",
        symbol="ρ",
        # What is withheld falls as 1/d⁴: at 3 footprints, little is left beyond. Contacts of six scenes were
        # nearest to the reference with 2 to 4, and a corner holds all its light with 3.
        default=3.0,
        low=0.5,
        high=16.0,
        scale="log",
        unit="VPL footprints",
        meaning="how far the screen-space near field reaches",
        fitted=False,
    ),
    ParameterSpec(
        name="screen_space_strength",
        symbol="s",
        default=0.0,
        low=0.0,
        high=2.0,
        scale="linear",
        unit="1",
        meaning="near field that α takes from the VPLs, given back from the screen: 0 none, 1 all of it",
        fitted=False,
    ),
)

LARGEST_DISC_COUNT = 4096
"""Most VPLs that are clustered: every RSM sample looks at every VPL. More are drawn as points."""

_SPECS = {spec.name: spec for spec in ARTIST_PARAMETERS}


def parameter_spec(name: str) -> ParameterSpec:
    """The row of the table called `name`; KeyError where there is none."""
    return _SPECS[name]


@dataclass(frozen=True)
class ArtistParameters:
    """A value for each row of `ARTIST_PARAMETERS`; made without arguments, the defaults.

    The constructor takes what it is given; `validated` is the way in for values from outside.
    """

    intensity: float = float(_SPECS["intensity"].default)
    falloff_footprint: float = float(_SPECS["falloff_footprint"].default)
    extinction_coefficient: float = float(_SPECS["extinction_coefficient"].default)
    visibility_bias: float = float(_SPECS["visibility_bias"].default)
    visibility_softness: float = float(_SPECS["visibility_softness"].default)
    vpl_count: int = int(_SPECS["vpl_count"].default)
    density_exponent: float = float(_SPECS["density_exponent"].default)
    density_importance: float = float(_SPECS["density_importance"].default)
    lloyd_iterations: int = int(_SPECS["lloyd_iterations"].default)
    screen_space_radius: float = float(_SPECS["screen_space_radius"].default)
    screen_space_strength: float = float(_SPECS["screen_space_strength"].default)

    @classmethod
    def validated(cls, values: Mapping[str, Any], where: str = "parameters") -> "ArtistParameters":
        """Parameters from a mapping that must hold every name of the table and no other.

        Args:
            values: name to number.
            where: what to call the mapping in an error, for example "tuned.json: parameters".

        Raises:
            InputError: a name is unknown or missing, or a value is not a finite number in range.
        """
        known = ", ".join(_SPECS)
        for name in values:
            if name not in _SPECS:
                raise InputError(f"{where}: unknown key {name!r:.60}; known are {known}")
        for name in _SPECS:
            if name not in values:
                raise InputError(f"{where}: key '{name}' is missing")
        # `checked` gives an int where the parameter is a whole number, which a checker of types cannot know.
        checked: dict[str, Any] = {name: spec.checked(values[name], where) for name, spec in _SPECS.items()}
        return cls(**checked)

    @property
    def vpls_are_discs(self) -> bool:
        """Whether VPLs are clustered disc lights; else they are points."""
        return self.lloyd_iterations > 0 and self.vpl_count <= LARGEST_DISC_COUNT

    def as_dict(self) -> dict[str, float | int]:
        """The values by name, in the table's order."""
        return {field.name: getattr(self, field.name) for field in fields(self)}


Placement = tuple[int, float, float, int]
"""N, γ, η, λ."""


def placement(parameters: ArtistParameters) -> Placement:
    """The parameters that VPLs are placed by: with equal ones, VPLs and their maps are the same."""
    return (
        parameters.vpl_count,
        parameters.density_exponent,
        parameters.density_importance,
        parameters.lloyd_iterations,
    )
