"""The light part of a config: which of a scene's light is drawn."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from vpltune.renderer.errors import InputError

MOST_BOUNCES = 64
"""Reflections that can be asked for. A choice: the reference's longest path (`BOUNCE_LIMIT` of
tuner/reference/indirect_irradiance.py)."""

Bounces = int | Literal["all"]


@dataclass(frozen=True)
class LightSettings:
    """Which light a frame has, in the runtime and in the reference alike.

    Raises:
        InputError: a field is out of range.
    """

    bounces: Bounces = 1
    """Reflections, at most, before light reaches the surface that the camera sees: 1 to 64, or "all"."""

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

    @property
    def most_bounces(self) -> int | None:
        """`bounces` as a number; None for all."""
        return None if self.bounces == "all" else int(self.bounces)

    def as_dict(self) -> dict[str, Any]:
        """The part as the file holds it."""
        return {"bounces": self.bounces}

    @classmethod
    def validated(cls, values: Any, where: str) -> "LightSettings":
        """The part from a file's content; keys that are absent have their defaults.

        Raises:
            InputError: not an object, an unknown key, or a value out of range. `where` names it.
        """
        if not isinstance(values, Mapping):
            raise InputError(f"{where}: must be an object, got {type(values).__name__}")
        for key in values:
            if key != "bounces":
                raise InputError(f"{where}: unknown key {key!r:.60}; known is bounces")
        bounces: Any = values.get("bounces", cls.bounces)
        if isinstance(bounces, float) and bounces.is_integer():
            bounces = int(bounces)
        # Checked before the object exists, so that the error names the file.
        unchecked = object.__new__(cls)
        object.__setattr__(unchecked, "bounces", bounces)
        unchecked.check(where)
        return cls(bounces)


def light_schema() -> dict[str, Any]:
    """JSON Schema of the key `light`."""
    return {
        "description": "Which of a scene's light is drawn.",
        "type": "object",
        "additionalProperties": False,
        "properties": {
            "bounces": {
                "description": "Reflections, at most, before light reaches what the camera sees.",
                "anyOf": [{"const": "all"}, {"type": "integer", "minimum": 1, "maximum": MOST_BOUNCES}],
                "default": LightSettings().bounces,
            }
        },
    }
