"""What a fit left on disk, as a report reads it: its own output, another version's, or a torn one."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vpltune.renderer.config.config_versions import OLDER_NAMES
from vpltune.renderer.errors import InputError
from vpltune.tuner.evaluation.view_images import ViewImages, read_view_images

METRICS = "metrics.json"
IMAGES = "images.npz"
_OLDER_IMAGES = "pictures.npz"
"""The name of the same file in version 0.1.0."""
_PRESENT_NAMES = {
    **OLDER_NAMES,
    "error_budget": "error_breakdown",
    "visibility_map_size": "map_size",
}
"""Names that version 0.1.0 wrote, to those of today: keys, and what lists hold."""
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
"""Keys of metrics.json that a page goes into; each may be absent."""
_OF_OBJECTS = ("per_view", "pareto", "uncertainty")


@dataclass(frozen=True, eq=False)
class FitFolder:
    """A fit's folder, read."""

    path: Path
    document: dict[str, Any]
    """metrics.json; numbers within may be null."""
    images: tuple[ViewImages, ...]

    def part(self, key: str) -> Any:
        """The object or list under `key`, empty where the fit made none."""
        return self.document.get(key) or _KINDS[key]()


def is_fit_folder(path: Path) -> bool:
    return (path / METRICS).is_file()


def read_fit_folder(path: Path) -> FitFolder:
    """Read metrics.json and images.npz below `path`.

    Raises:
        InputError: a file cannot be read, is not what its name says, or a key holds another kind of value.
    """
    document = _with_present_names(read_json_object(path / METRICS))
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


def _with_present_names(value: Any) -> Any:
    """`value` with the names of today wherever version 0.1.0 wrote others."""
    if isinstance(value, dict):
        return {_PRESENT_NAMES.get(key, key): _with_present_names(each) for key, each in value.items()}
    if isinstance(value, list):
        return [
            _PRESENT_NAMES.get(each, each) if isinstance(each, str) else _with_present_names(each)
            for each in value
        ]
    return value


def read_json_object(path: Path) -> dict[str, Any]:
    """The JSON object in `path`.

    Raises:
        InputError: it cannot be read, or holds something else.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not JSON ({error})") from error
    if not isinstance(document, dict):
        raise InputError(f"{path}: must be a JSON object, got {type(document).__name__}")
    return document


def split_figures(document: dict[str, Any], split: str, variant: str) -> dict[str, Any]:
    """relMSE, energy ratio and FLIP of a variant over the views of a split; empty where not known."""
    figures = (document.get("metrics") or {}).get(split)
    figures = figures.get(variant) if isinstance(figures, dict) else None
    return figures if isinstance(figures, dict) else {}
