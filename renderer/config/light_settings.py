"""The light part of a config: which of a scene's light is drawn."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from vpltune.renderer.errors import InputError

MOST_BOUNCES = 64
"""Reflections that can be asked for. A choice: the reference's longest path (`BOUNCE_LIMIT` of
tuner/reference/indirect_irradiance.py)."""
MOST_SKY_LIGHTS = 256
"""Lights that a sky may become. A choice: each draws the scene once."""

Bounces = int | Literal["all"]


@dataclass(frozen=True)
class LightSettings:
    """Which light a frame has, in the runtime and in the reference alike.

    Raises:
        InputError: a field is out of range.
    """

    bounces: Bounces = "all"
    """Reflections, at most, before light reaches the surface that the camera sees: 1 to 64, or "all"."""

    sky_lights: int = 32
    """Directional lights, each with a shadow map, that stand for the scene's sky or environment: 1 to 256."""

    def __post_init__(self) -> None:
        self.check("light")

    def check(self, where: str) -> None:
        """Raise InputError, naming `where`, if a field is out of range."""
        whole = isinstance(self.bounces, int) and not isinstance(self.bounces, bool)
        if self.bounces != "all" and not (whole and 1 <= int(self.bounces) <= MOST_BOUNCES):
            raise InputError(
                f'{where}.bounces: must be "all" or a whole number from 1 to {MOST_BOUNCES}, '
                f"got {self.bounces!r:.60}"
            )
        count = self.sky_lights
        if isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= MOST_SKY_LIGHTS:
            raise InputError(
                f"{where}.sky_lights: must be a whole number from 1 to {MOST_SKY_LIGHTS}, got {count!r:.60}"
            )

    @property
    def most_bounces(self) -> int | None:
        """`bounces` as a number; None for all."""
        return None if self.bounces == "all" else int(self.bounces)

    def as_dict(self) -> dict[str, Any]:
        """The part as the file holds it."""
        return asdict(self)

    @classmethod
    def validated(cls, values: Any, where: str) -> "LightSettings":
        """The part from a file's content; keys that are absent are as in `ONE_BOUNCE`.

        Raises:
            InputError: not an object, an unknown key, or a value out of range. `where` names it.
        """
        if not isinstance(values, Mapping):
            raise InputError(f"{where}: must be an object, got {type(values).__name__}")
        known = cls.__dataclass_fields__
        for key in values:
            if key not in known:
                raise InputError(f"{where}: unknown key {key!r:.60}; known are {', '.join(known)}")
        # Checked before the object exists, so that the error names the file.
        unchecked = object.__new__(cls)
        for name in known:
            value: Any = values.get(name, getattr(ONE_BOUNCE, name))
            # Some programs write 3 as 3.0.
            whole = isinstance(value, float) and value.is_integer()
            object.__setattr__(unchecked, name, int(value) if whole else value)
        unchecked.check(where)
        return cls(unchecked.bounces, unchecked.sky_lights)


ONE_BOUNCE = LightSettings(bounces=1)
"""What a config file has that says nothing of its light: such files are older than the key, and their
parameters were fitted to one bounce. Figures that were measured before there was more are of it too."""


def light_schema() -> dict[str, Any]:
    """JSON Schema of the key `light`."""
    return {
        "description": "Which of a scene's light is drawn. Files without it are of one bounce.",
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "bounces": {
                "description": "Reflections, at most, before light reaches what the camera sees.",
                "anyOf": [{"const": "all"}, {"type": "integer", "minimum": 1, "maximum": MOST_BOUNCES}],
                "default": ONE_BOUNCE.bounces,
            },
            "sky_lights": {
                "description": "Directional lights that stand for the scene's sky or environment.",
                "type": "integer",
                "minimum": 1,
                "maximum": MOST_SKY_LIGHTS,
                "default": ONE_BOUNCE.sky_lights,
            },
        },
    }
