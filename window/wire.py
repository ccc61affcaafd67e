"""The messages to browsers, as `README.md` lists them."""

import json
import struct
from pathlib import Path
from typing import Any

from vpltune.renderer.config.artist_parameters import ARTIST_PARAMETERS
from vpltune.renderer.config.quality import (
    INTERLEAVES,
    LARGEST_MAP,
    LARGEST_RSM,
    MAP_REFINEMENTS,
    SMALLEST_MAP,
    SMALLEST_RSM,
)
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError, MachineError
from vpltune.renderer.files.strict_json import strict_json
from vpltune.renderer.scene.views import camera_to_json, light_to_json
from vpltune.window.document import Document, NamedView
from vpltune.window.fit_watch import FitWatch
from vpltune.window.messages import LAYERS
from vpltune.window.requests import DrawnImage, Measured, Picked, SceneCard

QUALITIES: tuple[dict[str, Any], ...] = (
    {
        "name": "interleave",
        "meaning": "pixels of a block of this side share the VPLs; auto follows the size",
        "choices": ["auto", *INTERLEAVES],
    },
    {
        "name": "map_size",
        "meaning": "texels along the side of a visibility map",
        "low": SMALLEST_MAP,
        "high": LARGEST_MAP,
    },
    {
        "name": "map_refinement",
        "meaning": "rays along the side of a map texel that a silhouette crosses",
        "choices": list(MAP_REFINEMENTS),
    },
    {
        "name": "rsm_resolution",
        "meaning": "texels along the side of a light's map; auto is 1,024, or 512 for many faces",
        "choices": [
            "auto",
            *(SMALLEST_RSM << step for step in range((LARGEST_RSM // SMALLEST_RSM).bit_length())),
        ],
    },
)
"""The quality settings that a page offers, as rows of its table."""


def scene_message(card: SceneCard, tuning: str | None, paths: dict[str, Path]) -> dict[str, Any]:
    """`scene`: what does not change while the file does not.

    Args:
        card: what the drawing process says of the scene.
        tuning: why no fit can run; None if one can.
        paths: where things are saved if nobody says otherwise.
    """
    return {
        "type": "scene",
        "name": card.name,
        "bounds": [list(corner) for corner in card.bounds],
        "seconds": card.seconds,
        "parameters": [
            {
                "name": spec.name,
                "symbol": spec.symbol,
                "unit": spec.unit,
                "meaning": spec.meaning,
                "scale": spec.scale,
                "low": spec.low,
                "high": spec.high,
                "default": spec.default,
                "whole_number": spec.whole_number,
                "fitted": spec.fitted,
            }
            for spec in ARTIST_PARAMETERS
        ],
        "qualities": list(QUALITIES),
        "layers": list(LAYERS),
        "renderer": card.renderer,
        "camera": camera_to_json(card.camera),
        "tuning": tuning,
        "paths": {name: str(path) for name, path in paths.items()},
    }


def state_message(
    document: Document, presets: dict[str, TunedConfig], file_views: tuple[NamedView, ...], fit: FitWatch
) -> dict[str, Any]:
    """`state`: what everybody sees of the document and the fit."""
    configs = {"hand": document.now.config, "tuned": document.tuned, **presets}
    budget = document.now.config.quality.budget
    return {
        "type": "state",
        "configs": {
            name: None if config is None else _config(config, fit.intervals if name == "tuned" else {})
            for name, config in configs.items()
        },
        "lights": [{"name": each.light.name, **light_to_json(each.light)} for each in document.now.lights],
        "views": [
            {"name": view.name, "split": view.split, "camera": camera_to_json(view.camera)}
            for view in (*file_views, *document.now.kept)
        ],
        "unsaved": document.unsaved,
        "unsaved_lights": document.unsaved_lights,
        "unsaved_views": document.unsaved_views,
        "can_undo": document.undo_name is not None,
        "can_redo": document.redo_name is not None,
        "undo_name": document.undo_name,
        "redo_name": document.redo_name,
        "budget_ms": None if budget is None else budget.milliseconds,
        "fit": fit.message(),
    }


def notice(text: str, level: str = "info") -> dict[str, Any]:
    """`notice`: one line for the person at the page."""
    return {"type": "notice", "level": level, "text": text}


def explained(error: Exception) -> str:
    """One line for an error that a message or a file has caused."""
    if isinstance(error, InputError | MachineError):
        return str(error)
    return f"a defect of vpltune, please report it: {type(error).__name__}: {error}"


def image_message(drawn: DrawnImage, *, settled: bool, share: float, noise: float | None) -> bytes:
    """A binary message: the header's length, the header, the image.

    Args:
        drawn: the image; without bytes it says how far its reference is.
        settled: whether no finer one will come.
        share: of the reference's work done.
        noise: relMSE of the reference's noise.
    """
    request = drawn.request
    header = {
        "pane": request.pane,
        "source": request.source,
        "look": request.look,
        "size": list(request.view.size),
        "settled": settled,
        "milliseconds": drawn.milliseconds,
        "camera": camera_to_json(request.view.camera),
        "lights": None if drawn.lights is None else [light_to_json(light) for light in drawn.lights],
        "parameters": drawn.parameters,
        "share": share,
        "noise": noise,
    }
    text = json.dumps(header, allow_nan=False).encode("ascii")
    return struct.pack("<I", len(text)) + text + drawn.encoded


def picked_message(picked: Picked) -> dict[str, Any]:
    """`picked`: the surface at a place."""
    return {
        "type": "picked",
        "id": picked.request.id,
        "position": picked.position,
        "normal": picked.normal,
        "distance": picked.distance,
    }


def timings_message(measured: Measured) -> dict[str, Any]:
    """`timings`: milliseconds of each pass."""
    return {
        "type": "timings",
        "source": measured.request.source,
        "passes": [[name, each] for name, each in measured.passes.items()],
        "milliseconds": measured.milliseconds,
    }


def as_text(message: dict[str, Any]) -> str:
    """A message as JSON; a number that is not finite becomes null."""
    return strict_json(message, indent=None)


def _config(config: TunedConfig, intervals: dict[str, tuple[float, float]]) -> dict[str, Any]:
    return {
        "parameters": config.parameters.as_dict(),
        "quality": {**{row["name"]: "auto" for row in QUALITIES}, **config.quality.as_dict()},
        "intervals": {name: list(ends) for name, ends in intervals.items()},
        "status": None if config.fit is None else config.fit.status,
        "sentence": None if config.fit is None else config.fit.sentence,
    }
