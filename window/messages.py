"""What browsers say, checked, and applied to the document. `README.md` lists the messages."""

import json
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np

from vpltune.renderer.config.artist_parameters import parameter_spec
from vpltune.renderer.config.quality import LARGEST_SIDE, Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.scene import Camera
from vpltune.renderer.scene.views import camera_from_json, light_from_json
from vpltune.window.document import (
    CONFIG_NAMES,
    Document,
    Edited,
    NamedView,
    PlacedLight,
    edited_by_hand,
    with_parameter,
)

Source = Literal["default", "tuned", "hand", "auto", "reference", "signed_error", "flip"]
SOURCES: tuple[Source, ...] = get_args(Source)
ERRORS: tuple[Source, ...] = ("signed_error", "flip")
"""Sources that show the difference between a config's image and the reference."""
OF_REFERENCE: tuple[Source, ...] = ("reference", *ERRORS)
"""Sources that need a reference."""
Pane = Literal["a", "b"]
PANES: tuple[Pane, ...] = get_args(Pane)

WindowLayer = Literal[
    "final", "direct", "indirect", "irradiance", "albedo", "normal", "depth", "discs", "rsm", "maps"
]
LAYERS: tuple[WindowLayer, ...] = get_args(WindowLayer)

LARGEST_MESSAGE = 1 << 16
"""Bytes of a message from a browser. A choice: the longest, a light, takes a few hundred."""
AUTOMATIC = "auto"
"""What a page says for a setting that the config leaves out, or that follows the size."""
MOST_PIXELS = 2560 * 1440
"""Pixels of an image. A choice; a larger canvas is drawn smaller and scaled up."""
MOST_LIGHTS = 1000
"""Lights of the document. A choice: so many are tested to be drawn."""
MOST_VIEWS = 64
"""Kept views. A choice, and as many as a fit takes."""
LONGEST_NAME = 60
"""Characters of a view's name. A choice."""


@dataclass(frozen=True, eq=False)
class Look:
    """What one browser wants to see."""

    look: int
    camera: Camera
    size: tuple[int, int]
    """Width and height in pixels, within `MOST_PIXELS`."""
    moving: bool
    a: Source
    b: Source | None
    layer: WindowLayer
    error_of: Source
    seconds: float | None
    """Time of the animation; None for the rest pose."""


def parsed(text: str | bytes) -> dict[str, Any]:
    """A message as an object with a `type`.

    Raises:
        InputError: not JSON, or no such object.
    """
    try:
        message = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"message: not JSON ({error})") from error
    if not isinstance(message, dict) or not isinstance(message.get("type"), str):
        raise InputError("message: must be an object with a type")
    return message


def parsed_look(message: dict[str, Any]) -> Look:
    """A `look` message.

    Raises:
        InputError: a member is missing or has a value that it cannot have.
    """
    b = message.get("b")
    seconds = message.get("seconds")
    return Look(
        look=whole(message, "look"),
        camera=camera_from_json(message.get("camera"), "look.camera"),
        size=_size(message.get("size")),
        moving=message.get("moving") is True,
        a=_one_of(message.get("a"), SOURCES, "look.a"),
        b=None if b is None else _one_of(b, SOURCES, "look.b"),
        layer=_one_of(message.get("layer"), LAYERS, "look.layer"),
        error_of=_one_of(message.get("error_of", "hand"), CONFIG_NAMES, "look.error_of"),
        seconds=None if seconds is None else number(message, "seconds"),
    )


def number(message: dict[str, Any], key: str) -> float:
    """The finite number `key` of a message.

    Raises:
        InputError: it is missing, or no finite number.
    """
    value = message.get(key)
    # 1e300: whatever a page may say, and its square is still finite in no unit that matters.
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 1e300:
        raise InputError(f"{message['type']}.{key}: must be a finite number, got {value!r:.60}")
    return float(value)


def whole(message: dict[str, Any], key: str) -> int:
    """The whole number `key` of a message, at least 0.

    Raises:
        InputError: it is missing, or no such number.
    """
    value = number(message, key)
    if value < 0.0 or value != math.floor(value):
        raise InputError(f"{message['type']}.{key}: must be a whole number from 0, got {value:g}")
    return int(value)


def edit(document: Document, message: dict[str, Any], presets: dict[str, TunedConfig]) -> None:
    """Apply an `edit` message to the document.

    Raises:
        InputError: it says nothing that can be done; the document is then as before.
    """
    name, change = _change(document, message, presets)
    gesture = whole(message, "gesture") if "gesture" in message else None
    document.change(name, change, gesture)


def _change(
    document: Document, message: dict[str, Any], presets: dict[str, TunedConfig]
) -> tuple[str, Callable[[Edited], Edited]]:
    """The name of the undo step, and what it does."""
    if "parameter" in message:
        return _parameter_change(message)
    if "quality" in message:
        return _quality_change(message)
    if "take" in message:
        source = _one_of(message["take"], CONFIG_NAMES, "edit.take")
        config = document.config(source, presets)
        if config is None:
            raise InputError(f"edit.take: there is no config {source!r} yet")
        return f"take {source}", lambda now: replace(now, config=config)
    return _light_change(document, message)


def _parameter_change(message: dict[str, Any]) -> tuple[str, Callable[[Edited], Edited]]:
    name = message["parameter"]
    try:
        spec = parameter_spec(name)
    except (KeyError, TypeError):
        raise InputError(f"edit.parameter: there is no parameter {name!r:.60}") from None
    value = spec.checked(message.get("value"), "edit")
    return name.replace("_", " "), lambda now: with_parameter(now, name, value)


def _quality_change(message: dict[str, Any]) -> tuple[str, Callable[[Edited], Edited]]:
    name, value = message["quality"], message.get("value")
    if not isinstance(name, str) or name == "budget" or name not in Quality.__dataclass_fields__:
        raise InputError(f"edit.quality: there is no setting {name!r:.60}")

    def changed(now: Edited) -> Edited:
        members = {**now.config.quality.as_dict(), name: value}
        # Settings by hand no longer meet a budget that was met with others.
        members.pop("budget", None)
        if value == AUTOMATIC and name != "interleave":
            members.pop(name)
        quality = Quality.validated(members, "edit.quality")
        return replace(now, config=edited_by_hand(replace(now.config, quality=quality)))

    return name.replace("_", " "), changed


def _light_change(document: Document, message: dict[str, Any]) -> tuple[str, Callable[[Edited], Edited]]:
    lights = document.now.lights
    if "add_light" in message:
        if len(lights) >= MOST_LIGHTS:
            raise InputError(f"edit.add_light: at most {MOST_LIGHTS} lights")
        added = PlacedLight(light_from_json(message["add_light"], "edit.add_light"))
        return f"add a {added.light.kind} light", lambda now: replace(now, lights=(*now.lights, added))
    key = "remove_light" if "remove_light" in message else "light"
    index = whole(message, key)
    if index >= len(lights):
        raise InputError(f"edit.{key}: there are {len(lights)} lights, got {index}")
    if key == "remove_light":
        return "remove a light", lambda now: replace(now, lights=now.lights[:index] + now.lights[index + 1 :])
    light = replace(light_from_json(message.get("value"), "edit.value"), name=lights[index].light.name)
    return f"{light.kind} light", lambda now: replace(
        now, lights=(*now.lights[:index], PlacedLight(light), *now.lights[index + 1 :])
    )


def keep_view(document: Document, message: dict[str, Any]) -> None:
    """Apply a `keep_view` message: one more view of the list, or another camera for one of that name.

    Raises:
        InputError: the name or the camera cannot be used, or there are too many.
    """
    name = message.get("name")
    if not isinstance(name, str) or not name.strip() or len(name) > LONGEST_NAME:
        raise InputError(f"keep_view.name: must be 1 to {LONGEST_NAME} characters, got {name!r:.60}")
    view = NamedView(name.strip(), "kept", camera_from_json(message.get("camera"), "keep_view.camera"))
    others = tuple(each for each in document.now.kept if each.name != view.name)
    if len(others) >= MOST_VIEWS:
        raise InputError(f"keep_view: at most {MOST_VIEWS} views")
    document.change(f"keep {view.name}", lambda now: replace(now, kept=(*others, view)))


def remove_view(document: Document, message: dict[str, Any]) -> None:
    """Apply a `remove_view` message.

    Raises:
        InputError: no kept view has that name.
    """
    name = message.get("name")
    others = tuple(each for each in document.now.kept if each.name != name)
    if len(others) == len(document.now.kept):
        raise InputError(f"remove_view: no kept view is called {name!r:.60}")
    document.change(f"remove {name}", lambda now: replace(now, kept=others))


def _one_of(value: Any, allowed: tuple, where: str) -> Any:
    if not isinstance(value, str) or value not in allowed:
        raise InputError(f"{where}: must be one of {', '.join(allowed)}, got {value!r:.60}")
    return value


def _size(value: Any) -> tuple[int, int]:
    """Width and height, made smaller where the image would have more than `MOST_PIXELS`."""
    sides = value if isinstance(value, list) else []
    allowed = [side for side in sides if type(side) is int and 1 <= side <= LARGEST_SIDE]
    if len(sides) != 2 or len(allowed) != 2:
        raise InputError(f"size: must be two whole numbers from 1 to {LARGEST_SIDE}, got {value!r:.60}")
    width, height = allowed
    shrink = max(1.0, math.sqrt(width * height / MOST_PIXELS))
    width, height = np.maximum(1, np.floor(np.array([width, height]) / shrink)).astype(int).tolist()
    return width, height
