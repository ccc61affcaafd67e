"""The scenes that are measured: our own, and those of others that lie outside the repository."""

import os
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]

OWN_SCENES = tuple(sorted((REPOSITORY / "configs" / "scenes").glob("*.glb")))

OUTSIDE_SCENES = {
    "babylon-marble-tower": "marbleTower.gltf",
    "bevy-cornellbox": "CornellBox.glb",
    "bevy-depthoffieldexample": "DepthOfFieldExample.glb",
    "bevy-irradiancevolumeexample": "IrradianceVolumeExample.glb",
    "bevy-mixedlightingexample": "MixedLightingExample.gltf",
    "cube2-steelribs": "steelribs.obj",
    "godot-living-room": "living_room.glb",
    "godot-zdm2": "zdm2.glb",
    "kajiya-cornell-box": "scene.gltf",
    "nvpro-cornellbox": "cornellBox.gltf",
    "playcanvas-chess-board": "chess-board.glb",
    "playcanvas-house": "house.glb",
    "sketchfab-macross-diorama": "scene.glb",
}
"""Every scene of others that can be loaded: folder and file."""


def scenes_folder() -> Path:
    """The folder of others' scenes: the environment variable VPLTUNE_SCENES, else one beside the checkout."""
    return Path(os.environ.get("VPLTUNE_SCENES") or REPOSITORY.parent / "shared" / "scenes")


def present_scenes() -> dict[str, Path]:
    """Name to file of every scene, ours and others', that is there."""
    others = {name: scenes_folder() / name / file for name, file in OUTSIDE_SCENES.items()}
    return {path.stem: path for path in OWN_SCENES} | {n: p for n, p in others.items() if p.is_file()}
