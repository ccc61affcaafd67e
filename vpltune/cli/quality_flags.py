"""Flags that override a config: `--visibility` and those of its quality part."""

from dataclasses import replace
from typing import Any

from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig, Visibility
from vpltune.renderer.errors import InputError


def with_flags(
    config: TunedConfig, *, visibility: Visibility | None = None, **quality: int | None
) -> tuple[TunedConfig, tuple[str, ...]]:
    """`config` with what the flags say, and a sentence for each value of its own that one overrides.

    Args:
        config: what was read.
        visibility: None keeps the config's own.
        quality: fields of `Quality`; None keeps the config's own.

    Raises:
        InputError: a value is out of range, or the visibility does not go with the config's prior.
    """
    given: dict[str, Any] = {name: value for name, value in quality.items() if value is not None}
    for name, value in given.items():
        try:
            Quality(**{name: value})
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
        # What a budget was met with is no longer what is drawn.
        changed = replace(changed, quality=replace(changed.quality, **given, budget=None))
    return changed, notes


def _is_default(name: str, value: object) -> bool:
    """Whether a config says no more than a file without the key would."""
    return getattr(TunedConfig(), name, getattr(Quality(), name, None)) == value
