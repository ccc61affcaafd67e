"""What a window edits: the config by hand, the lights and the kept views, with their history."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.scene.scene import Camera, Light

ConfigName = Literal["default", "tuned", "hand", "auto"]
CONFIG_NAMES: tuple[ConfigName, ...] = get_args(ConfigName)

LONGEST_HISTORY = 500
"""Undo steps that are kept. A choice: a step takes about a kilobyte."""


@dataclass(frozen=True, eq=False)
class PlacedLight:
    """A light of the document."""

    light: Light
    follows: int | None = None
    """The light of the scene file whose animation it takes part in; None once it was edited."""


@dataclass(frozen=True, eq=False)
class NamedView:
    """A camera of the list."""

    name: str
    split: str
    """As in `views.json`, or `file` for a camera of the scene file, or `kept`."""
    camera: Camera


@dataclass(frozen=True, eq=False)
class Edited:
    """All that undo brings back."""

    config: TunedConfig
    lights: tuple[PlacedLight, ...]
    kept: tuple[NamedView, ...] = ()


@dataclass(frozen=True, eq=False)
class _Step:
    name: str
    gesture: int | None
    before: Edited


@dataclass(eq=False)
class Document:
    """The document of a window. Every change goes through `change`, `undo` or `redo`.

    Example:
        >>> document = Document(Edited(config, lights))
        >>> document.change("intensity", gesture=1, change=lambda now: replace(now, config=other))
        >>> document.undo()
    """

    now: Edited
    tuned: TunedConfig | None = None
    """The config that the window was opened with, or that the last fit found."""
    _done: list[_Step] = field(default_factory=list)
    _undone: list[_Step] = field(default_factory=list)
    _saved: TunedConfig | None = None
    _saved_lights: tuple[PlacedLight, ...] = ()
    _saved_views: tuple[NamedView, ...] = ()

    def __post_init__(self) -> None:
        self.mark_saved()
        self.mark_lights_saved()

    def config(self, name: str, presets: dict[str, TunedConfig]) -> TunedConfig | None:
        """The config called `name`; None where there is none yet."""
        own = {"hand": self.now.config, "tuned": self.tuned}
        return own[name] if name in own else presets.get(name)

    def change(self, name: str, change: Callable[[Edited], Edited], gesture: int | None = None) -> None:
        """Replace the present state by what `change` makes of it.

        Args:
            name: of the undo step, for people.
            change: gives the new state, or raises and leaves everything as it was.
            gesture: changes in a row with the same number are one undo step; None is never joined.
        """
        changed = change(self.now)
        last = self._done[-1] if self._done else None
        joined = last is not None and gesture is not None and last.gesture == gesture
        if not joined:
            self._done.append(_Step(name, gesture, self.now))
            del self._done[:-LONGEST_HISTORY]
        self._undone.clear()
        self.now = changed

    def undo(self) -> None:
        """Take back the last step, if there is one."""
        if self._done:
            step = self._done.pop()
            self._undone.append(_Step(step.name, None, self.now))
            self.now = step.before

    def redo(self) -> None:
        """Bring back the step that `undo` took back last, if there is one."""
        if self._undone:
            step = self._undone.pop()
            self._done.append(_Step(step.name, None, self.now))
            self.now = step.before

    @property
    def undo_name(self) -> str | None:
        """What `undo` would take back."""
        return self._done[-1].name if self._done else None

    @property
    def redo_name(self) -> str | None:
        """What `redo` would bring back."""
        return self._undone[-1].name if self._undone else None

    def mark_saved(self) -> None:
        """The config by hand is on disk as it stands."""
        self._saved = self.now.config

    def mark_lights_saved(self) -> None:
        """The lights are on disk as they stand."""
        self._saved_lights = self.now.lights

    def mark_views_saved(self) -> None:
        """The kept views are on disk as they stand."""
        self._saved_views = self.now.kept

    @property
    def unsaved(self) -> bool:
        """Whether the config by hand draws other images than the one that was opened or saved last."""
        return self._saved is None or not self.now.config.draws_as(self._saved)

    @property
    def unsaved_lights(self) -> bool:
        """Whether lights were changed since they were opened or saved."""
        before, now = self._saved_lights, self.now.lights
        return len(before) != len(now) or any(
            a.light is not b.light for a, b in zip(before, now, strict=True)
        )

    @property
    def unsaved_views(self) -> bool:
        """Whether views were kept or removed since the window was opened or they were saved."""
        return self.now.kept != self._saved_views

    @property
    def all_saved(self) -> bool:
        """Whether nothing would be lost."""
        return not (self.unsaved or self.unsaved_lights or self.unsaved_views)


def with_parameter(edited: Edited, name: str, value: float | int) -> Edited:
    """The state with another value of one parameter; a prior gives way to values."""
    parameters = replace(edited.config.parameters, **{name: value})
    return replace(edited, config=edited_by_hand(edited.config.with_parameters(parameters)))


def edited_by_hand(config: TunedConfig) -> TunedConfig:
    """The config without the note of the fit that it came from, whose numbers it no longer has."""
    return replace(config, fit=None, provenance={})
