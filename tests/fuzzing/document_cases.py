"""Cases of our own small files: sidecar, `--views` and config."""

import copy
import json
import random
from functools import cache
from pathlib import Path
from typing import Any

from tests.fuzzing.byte_mutations import mutate_bytes
from tests.fuzzing.tree_mutations import mutate_tree
from tests.fuzzing.tree_text import json_text, toml_text
from vpltune.renderer.config.config_versions import OLDER_NAMES
from vpltune.renderer.config.tuned_config import FORMAT, config_text, read_config

_SIDECAR: dict[str, Any] = {
    "camera": {"eye": [3.6, 2.7, -1.7], "look_at": [-2.0, 1.7, 0.9], "yfov_degrees": 65.0},
    "light": [
        {
            "type": "spot",
            "position": [0.3, 3.3, 0.2],
            "look_at": [0.0, 0.0, 0.3],
            "intensity": 10.0,
            "inner_cone_degrees": 35.0,
            "outer_cone_degrees": 55.0,
            "range": 8.0,
        },
        {"type": "point", "position": [0, 1, 0], "intensity": [1.0, 2.0, 3.0]},
        {"type": "directional", "direction": [0.0, -1.0, 0.1], "intensity": 2},
    ],
    "sky": {"environment": "sky.exr", "scale": 2.0, "rotation": 30.0},
}
_SPOT: dict[str, Any] = {
    "type": "spot",
    "position": [0, 2, 0],
    "direction": [0, -1, 0],
    "intensity": [1, 1, 1],
}
_VIEWS: dict[str, Any] = {
    "scene": "scene.glb",
    "views": [
        {
            "name": "first",
            "split": "fitted",
            "size": [64, 48],
            "camera": {"to_world": [1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1, 5, 0, 0, 0, 1], "yfov": 0.9},
            "lights": [_SPOT | {"inner_cone": 0.1, "outer_cone": 0.8, "range": 4.0}],
        },
        {
            "name": "second",
            "split": "held_out",
            "size": [64, 48],
            "camera": {"to_world": [1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1, 5, 0, 0, 0, 1], "yfov": 0.9},
            "lights": [
                {"type": "point", "position": [0, 2, 0], "intensity": [1, 1, 1]},
                {"type": "directional", "direction": [0, -1, 0.1], "intensity": [1, 1, 1]},
            ],
        },
    ],
}


def write_sidecar_case(folder: Path, rng: random.Random, mutated: bool) -> Path:
    """Write a case into `folder`; the path of the sidecar."""
    return _write(folder / "scene.vpltune.toml", copy.deepcopy(_SIDECAR), rng, mutated)


def write_views_case(folder: Path, rng: random.Random, mutated: bool) -> Path:
    """Write a case into `folder`; the path of the views file."""
    return _write(folder / "views.json", copy.deepcopy(_VIEWS), rng, mutated)


def write_config_case(folder: Path, rng: random.Random, mutated: bool) -> Path:
    """Write a case into `folder`: a config of this version or an older one, alone or inside a glTF file."""
    document = copy.deepcopy(rng.choice(_configs()))
    if rng.random() < 0.2:
        holder = {"asset": {"version": "2.0", "extras": {"vpltune": document}}, "scenes": [{"nodes": []}]}
        return _write(folder / "tuned.gltf", holder, rng, mutated)
    return _write(folder / "tuned.json", document, rng, mutated)


@cache
def _configs() -> tuple[dict[str, Any], ...]:
    """The presets, one with every key, and one of version 1, without checksums, which would hide the rest."""
    presets = [json.loads(config_text(read_config(name))) for name in ("default", "auto")]
    full = copy.deepcopy(presets[0])
    full["quality"]["rsm_resolution"] = 512
    full["quality"]["budget"] = {"milliseconds": 16.0, "frame_size": [960, 540], "machine": "a GPU"}
    full["fit"] = {"status": "converged", "sentence": "12 steps."}
    full["light"] = {"bounces": 3, "sky_lights": 16}
    full["provenance"] = {"scene": "room.glb", "seed": 1, "loss": 0.25}
    older_names = {newer: older for older, newer in OLDER_NAMES.items()}
    parameters = {older_names.get(name, name): value for name, value in full["parameters"].items()}
    old = {
        "format": FORMAT,
        "version": 1,
        "visibility": "maps",
        "parameters": parameters | {"density_relaxation": 2},
        "provenance": {"status": "converged", "fit": "12 steps."},
    }
    for document in presets:
        document.pop("checksum")
    full.pop("checksum")
    return (*presets, full, old)


def _write(path: Path, tree: dict[str, Any], rng: random.Random, mutated: bool) -> Path:
    in_tree = mutated and rng.random() < 0.9
    if in_tree:
        mutate_tree(tree, rng)
    text = toml_text(tree) if path.suffix == ".toml" else json_text(tree)
    content = text.encode("utf-8", "surrogatepass")
    path.write_bytes(mutate_bytes(content, rng) if mutated and not in_tree else content)
    return path
