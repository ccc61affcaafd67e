"""Read the output folder of a fit. It may come from another version, or be incomplete."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vpltune.renderer.config.config_versions import OLDER_NAMES
from vpltune.renderer.errors import InputError
from vpltune.renderer.files.small_text import read_small_text
from vpltune.tuner.evaluation.view_images import ViewImages, read_view_images

METRICS = "metrics.json"
"""File with the figures of a fit."""
IMAGES = "images.npz"
"""File with the linear images of a fit."""
_OLDER_IMAGES = "pictures.npz"
"""Name of the same file in version 0.1.0."""
_PRESENT_NAMES = {
    **OLDER_NAMES,
    "error_budget": "error_breakdown",
    "visibility_map_size": "map_size",
}
"""Names that version 0.1.0 wrote, as keys or in lists, and their present names."""
_KINDS = {
    "parameters": dict,
    "metrics": dict,
    "seconds": dict,
    "loss": dict,
    "provenance": dict,
    "uncertainty": dict,
    "error_breakdown": dict,
    "budget": dict,
    "per_view": list,
    "notes": list,
    "pareto": list,
}
"""Type of each key of metrics.json that a page reads. Every key is optional."""
LARGEST_FILE = 1 << 28
"""A choice: most bytes of a JSON file that a report reads: room for millions of scenes of a batch."""
LARGEST_NUMBER = 1e100
"""A choice: what is larger is damage, and differences of it leave double precision."""
_OF_OBJECTS = ("per_view", "pareto", "uncertainty")
"""Keys whose members must be objects."""


@dataclass(frozen=True, eq=False)
class FitFolder:
    """Contents of the output folder of a fit."""

    path: Path
    document: dict[str, Any]
    """metrics.json. Any number in it may be null."""
    images: tuple[ViewImages, ...]
    """Images of each view; empty if the fit kept none."""

    def part(self, key: str) -> Any:
        """The object or list under `key`; empty if the key is missing."""
        return self.document.get(key) or _KINDS[key]()


def is_fit_folder(path: Path) -> bool:
    """Whether `path` is the output folder of a fit, that is, holds metrics.json."""
    return (path / METRICS).is_file()


def read_fit_folder(path: Path) -> FitFolder:
    """Read metrics.json and images.npz in `path`.

    Raises:
        InputError: a file cannot be read or is malformed, or a key holds a value of another type.
    """
    document = _with_present_names(read_json_object(path / METRICS))
    _check_numbers(document, path / METRICS)
    for key, kind in _KINDS.items():
        value = document.get(key)
        if value is not None and not isinstance(value, kind):
            expected = "an object" if kind is dict else "a list"
            raise InputError(f"{path / METRICS}: key '{key}' must be {expected}, got {value!r:.60}")
        if key in _OF_OBJECTS:
            for member in value.values() if isinstance(value, dict) else value or ():
                if not isinstance(member, dict):
                    raise InputError(f"{path / METRICS}: key '{key}' must hold objects, got {member!r:.60}")
    images = path / IMAGES
    return FitFolder(path, document, read_view_images(images if images.exists() else path / _OLDER_IMAGES))


def _check_numbers(value: Any, path: Path) -> None:
    """Refuse numbers that no axis could be drawn about. What is not finite is shown as a dash."""
    if isinstance(value, dict | list):
        for each in value.values() if isinstance(value, dict) else value:
            _check_numbers(each, path)
    elif isinstance(value, int | float) and LARGEST_NUMBER < abs(value) < math.inf:
        raise InputError(f"{path}: numbers must be at most {LARGEST_NUMBER:g}, got {value!r:.40}")


def _with_present_names(value: Any) -> Any:
    """A JSON value with the keys of version 0.1.0 replaced by their present names, at every depth."""
    if isinstance(value, dict):
        return {_PRESENT_NAMES.get(key, key): _with_present_names(each) for key, each in value.items()}
    if isinstance(value, list):
        return [
            _PRESENT_NAMES.get(each, each) if isinstance(each, str) else _with_present_names(each)
            for each in value
        ]
    return value


def read_json_object(path: Path) -> dict[str, Any]:
    """Read the JSON object in `path`.

    Raises:
        InputError: the file cannot be read, is not JSON, or holds another type of value.
    """
    text = read_small_text(path, LARGEST_FILE)
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not JSON ({error})") from error
    if not isinstance(document, dict):
        raise InputError(f"{path}: must be a JSON object, got {type(document).__name__}")
    return document


def split_figures(document: Mapping[str, Any], split: str, variant: str) -> dict[str, Any]:
    """The figures of a variant over the views of a split, by name; empty if unknown."""
    figures = (document.get("metrics") or {}).get(split)
    figures = figures.get(variant) if isinstance(figures, dict) else None
    return figures if isinstance(figures, dict) else {}
