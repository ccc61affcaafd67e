"""Flags that override a config: `--visibility` and the quality settings."""

from dataclasses import replace
from typing import Any

from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig, Visibility
from vpltune.renderer.errors import InputError


def with_flags(
    config: TunedConfig, *, visibility: Visibility | None = None, **quality: int | str | None
) -> tuple[TunedConfig, tuple[str, ...]]:
    """Override values of a config by flags.

    Args:
        config: the config that was read.
        visibility: None keeps the config's own.
        quality: fields of `Quality`, as numbers or as words of the command line; None keeps the config's
            own.

    Returns:
        The config, and a sentence for each value other than the default that a flag overrides.

    Raises:
        InputError: a value is out of range, or the config has a prior that was trained with another
            visibility.
    """
    given: dict[str, Any] = {
        name: int(value) if isinstance(value, str) and _is_number(value) else value
        for name, value in quality.items()
        if value is not None
    }
    for name, value in given.items():
        try:
            Quality.validated({name: value}, "quality")
        except InputError as error:
            rule = str(error).partition(": ")[2]
            raise InputError(f"--{name.replace('_', '-')}: {rule}") from error
    own = {"visibility": config.visibility, **{name: getattr(config.quality, name) for name in given}}
    asked = {**({} if visibility is None else {"visibility": visibility}), **given}
    notes = tuple(
        f"--{name.replace('_', '-')} {value} overrides the config, which has {own[name]}"
        for name, value in asked.items()
        if own[name] != value and not _is_default(name, own[name])
    )
    changed = config.seen_by(visibility)
    if given:
        # The budget was met with other settings.
        changed = replace(changed, quality=replace(changed.quality, **given, budget=None))
    return changed, notes


def _is_number(text: str) -> bool:
    # Python refuses to read numbers of thousands of digits; no setting has ten.
    return text.isdecimal() and len(text) < 10


def _is_default(name: str, value: object) -> bool:
    """Whether `value` is what a config without this key has."""
    return getattr(TunedConfig(), name, getattr(Quality(), name, None)) == value
