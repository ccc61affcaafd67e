"""The scenes that benchmarks measure: the shipped ones, and third-party ones outside the repository."""

import os
from pathlib import Path

from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import resolve_camera_and_lights, with_environment
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View

REPOSITORY = Path(__file__).resolve().parents[2]

OWN_SCENES = tuple(sorted((REPOSITORY / "configs" / "scenes").glob("*.glb")))
"""The files of all shipped scenes."""

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
"""Folder and file of each third-party scene."""

MITSUBA_SCENES = {"bitterli-living-room": "scene.xml", "bitterli-staircase2": "scene.xml"}
"""Folder and file of each third-party scene that must be imported."""

KEPT_AWAY = ("bevy-depthoffieldexample", "cube2-steelribs", "kajiya-cornell-box", "playcanvas-house")
"""Third-party scenes that choose nothing (docs/chosen_on.md)."""
CHOOSING_SEED, REPORTED_SEED = 100, 20261129
"""Seeds of generated scenes: of those that may choose something, and of those that choose nothing."""


def own_scene(name: str) -> Path:
    """The file of the shipped scene `name`."""
    return REPOSITORY / "configs" / "scenes" / f"{name}.glb"


def scenes_folder() -> Path:
    """The folder of third-party scenes: VPLTUNE_SCENES if set, else shared/scenes beside the checkout."""
    return Path(os.environ.get("VPLTUNE_SCENES") or REPOSITORY.parent / "shared" / "scenes")


def present_scenes() -> dict[str, Path]:
    """Name and file of every shipped scene, and of every third-party scene that exists on this machine."""
    others = {name: scenes_folder() / name / file for name, file in OUTSIDE_SCENES.items()}
    return {path.stem: path for path in OWN_SCENES} | {n: p for n, p in others.items() if p.is_file()}


def scene_and_view(path: Path, size: tuple[int, int]) -> tuple[Scene, View]:
    """Read a scene, and make a view of its own camera and lights, or of placed ones where it has none."""
    scene = with_environment(read_scene(path), path)
    camera, lights, _ = resolve_camera_and_lights(scene, path, None, None)
    return scene, View(path.stem, "fitted", size, camera, lights)
