"""Saves and loads what the window edits, in the files that the command line writes and reads."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

from vpltune.renderer.config.tuned_config import TunedConfig, config_text, parse_config, write_config
from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import write_text_whole, written_together
from vpltune.renderer.files.image_file import require_extension
from vpltune.renderer.scene.placement.scene_sidecar import read_sidecar
from vpltune.renderer.scene.placement.sidecar_file import sidecar_path, sidecar_text
from vpltune.renderer.scene.scene import Camera
from vpltune.renderer.scene.views import (
    View,
    camera_from_json,
    camera_to_json,
    light_from_json,
    light_to_json,
    write_views,
)
from vpltune.window.document import Edited, NamedView, PlacedLight

VIEW_SIZE = (960, 540)
"""Width and height of a saved view, in pixels; that of `vpltune render`."""


def usual_paths(scene: Path | None, config: Path | None, output: Path | None) -> dict[str, Path]:
    """Where the config, the sidecar and the views are saved if nobody says otherwise.

    Args:
        scene: the scene's file; None for a scene in memory.
        config: the config file that the window was opened with.
        output: the folder that the window was told to save to.
    """
    stem = "scene" if scene is None else scene.stem
    folder = output or (config.parent if config is not None else Path("out") / stem)
    return {
        "config": config if config is not None and output is None else folder / "tuned.json",
        "sidecar": sidecar_path(scene) if scene is not None else folder / "scene.vpltune.toml",
        "views": folder / "views.json",
    }


def save_config(path: Path, config: TunedConfig, fit_folder: Path | None) -> str:
    """Write a config, and the other files of the fit that found it beside it; returns one line.

    Args:
        path: a .json file.
        config: as it is to be read again.
        fit_folder: what `vpltune fit` would have written; None if the config is not a fit's.

    Raises:
        InputError, MachineError: the file cannot be written.
    """
    require_extension(path, ".json")
    if fit_folder is None or path.name != "tuned.json":
        write_config(path, config)
        return f"wrote {path}"
    with written_together(path.parent) as folder:
        for each in sorted(fit_folder.iterdir()):
            shutil.copyfile(each, folder / each.name)
        write_config(folder / "tuned.json", config)
    return f"wrote {path}, and metrics, views and images of the fit beside it"


def save_sidecar(path: Path, camera: Camera, lights: tuple[PlacedLight, ...]) -> str:
    """Write camera and lights as a scene's sidecar, which keeps its sky; returns one line.

    Raises:
        InputError: it is no sidecar's name, or the sidecar that is there is invalid.
        MachineError: the file cannot be written.
    """
    if not path.name.endswith(".vpltune.toml"):
        raise InputError(f"{path}: a sidecar's name ends in .vpltune.toml")
    sky = read_sidecar(path).sky if path.is_file() else None
    write_text_whole(path, sidecar_text(camera, [each.light for each in lights], sky))
    return f"wrote {path} (camera, {_counted(len(lights), 'light')})"


def save_views(path: Path, scene: str, camera: Camera, now: Edited) -> str:
    """Write the page's view and the kept ones as views.json; returns one line.

    Raises:
        InputError, MachineError: the file cannot be written.
    """
    require_extension(path, ".json")
    lights = tuple(each.light for each in now.lights)
    views = [View("page", "fitted", VIEW_SIZE, camera, lights)]
    views += [View(each.name, "fitted", VIEW_SIZE, each.camera, lights) for each in now.kept]
    write_views(path, scene, tuple(views))
    return f"wrote {path} ({_counted(len(views), 'view')})"


def recovery_text(now: Edited) -> str:
    """Config, lights and kept views as one JSON document, for `recovered`."""
    document: dict[str, Any] = {
        "config": json.loads(config_text(now.config)),
        "lights": [
            {"follows": each.follows, "name": each.light.name, **light_to_json(each.light)}
            for each in now.lights
        ],
        "kept": [{"name": each.name, "camera": camera_to_json(each.camera)} for each in now.kept],
    }
    return json.dumps(document, allow_nan=False)


def recovered(text: str, where: str, now: Edited) -> Edited:
    """The state that `recovery_text` wrote, in the place of `now`.

    Raises:
        InputError: the text is not what it wrote.
    """
    try:
        document = json.loads(text)
        config = parse_config(json.dumps(document["config"]), where)
        lights = tuple(
            PlacedLight(
                replace(light_from_json(each, where), name=str(each.get("name", ""))), each.get("follows")
            )
            for each in document["lights"]
        )
        kept = tuple(
            NamedView(str(each["name"]), "kept", camera_from_json(each["camera"], where))
            for each in document["kept"]
        )
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError(f"{where}: not a file of unsaved changes ({error})") from error
    return replace(now, config=config, lights=lights, kept=kept)


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'s' * (count != 1)}"
