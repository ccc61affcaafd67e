"""The light part of a config: which of a scene's light is drawn."""

from dataclasses import asdict, dataclass
from typing import Any, Literal

from vpltune.renderer.config.member_rules import check_whole, known_members, whole_as_int

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
        if self.bounces != "all":
            check_whole(self.bounces, 1, MOST_BOUNCES, f"{where}.bounces", "all")
        check_whole(self.sky_lights, 1, MOST_SKY_LIGHTS, f"{where}.sky_lights")

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
        known = tuple(cls.__dataclass_fields__)
        members = known_members(values, known, where)
        # Checked before the object exists, so that the error names the file.
        unchecked = object.__new__(cls)
        for name in known:
            value = whole_as_int(members.get(name, getattr(ONE_BOUNCE, name)))
            object.__setattr__(unchecked, name, value)
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
