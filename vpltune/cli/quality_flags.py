"""Flags that override a config: `--visibility`, the quality settings and those of the light."""

from dataclasses import replace
from typing import Any

from vpltune.renderer.config.light_settings import LightSettings
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig, Visibility
from vpltune.renderer.errors import InputError

_LIGHT = tuple(LightSettings.__dataclass_fields__)


def with_flags(
    config: TunedConfig, *, visibility: Visibility | None = None, **settings: int | str | None
) -> tuple[TunedConfig, tuple[str, ...]]:
    """Override values of a config by flags.

    Args:
        config: the config that was read.
        visibility: None keeps the config's own.
        settings: fields of `Quality` and `LightSettings`, as numbers or as words of the command line; None
            keeps the config's own.

    Returns:
        The config, and a sentence for each value other than the default that a flag overrides.

    Raises:
        InputError: a value is out of range, or the config has a prior that was trained with another
            visibility.
    """
    given: dict[str, Any] = {
        name: int(value) if isinstance(value, str) and _is_number(value) else value
        for name, value in settings.items()
        if value is not None
    }
    for name, value in given.items():
        try:
            part = LightSettings if name in _LIGHT else Quality
            part.validated({name: value}, "config")
        except InputError as error:
            rule = str(error).partition(": ")[2]
            raise InputError(f"--{name.replace('_', '-')}: {rule}") from error
    own = {
        "visibility": config.visibility,
        **{name: getattr(config.light if name in _LIGHT else config.quality, name) for name in given},
    }
    asked = {**({} if visibility is None else {"visibility": visibility}), **given}
    notes = tuple(
        f"--{name.replace('_', '-')} {value} overrides the config, which has {own[name]}"
        for name, value in asked.items()
        if own[name] != value and not _is_default(name, own[name])
    )
    changed = config.seen_by(visibility)
    light = {name: given.pop(name) for name in _LIGHT if name in given}
    if given:
        changed = replace(changed, quality=replace(changed.quality, **given))
    if given or light:
        # The budget was met with other settings.
        quality = replace(changed.quality, budget=None)
        changed = replace(changed, quality=quality, light=replace(changed.light, **light))
    return changed, notes


def _is_number(text: str) -> bool:
    # Python refuses to read numbers of thousands of digits; no setting has ten.
    return text.isdecimal() and len(text) < 10


def _is_default(name: str, value: object) -> bool:
    """Whether `value` is what the default config has."""
    default = TunedConfig()
    parts = (default, default.quality, default.light)
    return next(getattr(part, name) for part in parts if hasattr(part, name)) == value
