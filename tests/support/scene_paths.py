"""Where the scenes of tests lie."""

from pathlib import Path

from benchmarks.harness.scene_library import OUTSIDE_SCENES, OWN_SCENES

__all__ = ["OUTSIDE_SCENES", "OWN_SCENES", "outside_scene"]


def outside_scene(scenes_folder: Path, name: str) -> Path:
    return scenes_folder / name / OUTSIDE_SCENES[name]
