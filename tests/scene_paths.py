"""Where the scenes of tests and measurements lie."""

from pathlib import Path

OWN_SCENES = tuple(sorted((Path(__file__).parent.parent / "configs" / "scenes").glob("*.glb")))

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
}
"""Every scene of others that can be loaded: folder and file."""


def outside_scene(scenes_folder: Path, name: str) -> Path:
    return scenes_folder / name / OUTSIDE_SCENES[name]
