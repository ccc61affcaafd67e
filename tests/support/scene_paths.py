"""Where the scenes of tests lie."""

from pathlib import Path

OWN_SCENES = tuple(sorted((Path(__file__).resolve().parents[2] / "configs" / "scenes").glob("*.glb")))

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
"""Folder and file of each third-party scene that the scene readers accept."""


def outside_scene(scenes_folder: Path, name: str) -> Path:
    return scenes_folder / name / OUTSIDE_SCENES[name]
