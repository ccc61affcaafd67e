"""Flicker where surfaces that glow move, and how soon light arrives where a door opens.

In the first clip a glowing panel is carried through the small room of `room_and_hall`. In the second it
stands in the hall, and a door between hall and room opens while the camera looks at the room's far wall.

Flicker is the mean absolute change of irradiance from frame to frame over the mean irradiance, minus the same
figure with `REFERENCE_VPLS` discs, gathered in full. Delay is how many frames later the clip, which carries
its discs from frame to frame, has half of its last frame's light than stills have half of theirs.

`python -m benchmarks.quality.moving_emitters FOLDER` writes panel.mp4 and door.mp4.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Float64

from benchmarks.harness.row import Row
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.video_file import clip_writer
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.animation import Pose
from vpltune.renderer.scene.scene import Camera, Instance, Material, Scene
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View
from vpltune.tuner.prior.scene_generator import parallelograms, room_and_hall

SIZE = (48, 36)
"""Width and height of the measured images in pixels. A choice."""
CLIP_SIZE = (480, 360)
"""Width and height of the written clips in pixels. A choice."""
CLIP_FPS = 30.0
"""Frames per second of the written clips. A choice."""
FRAMES = 24
"""Frames of a clip. A choice: most of a second at `CLIP_FPS`, for a door that is pushed open."""
REFERENCE_VPLS = 1024
"""Discs of the reference. A choice: twice the default."""
RADIANCE = 40.0
"""Radiance of the panel, W/(m² sr). A choice: flicker and delay are ratios."""


@dataclass(frozen=True, eq=False)
class Clip:
    """A scene of which an instance moves, and its transforms at each frame."""

    name: str
    scene: Scene
    view: View
    transforms: tuple[Float64[np.ndarray, "instances 4 4"], ...]


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Flicker of direct and reflected light of both clips, and the delay behind the door."""
    found = []
    fine = TunedConfig(ArtistParameters(vpl_count=REFERENCE_VPLS), quality=Quality(interleave=1))
    for clip in (carried_panel(), opened_door()):
        progress(f"moving emitters, {clip.name}", 0.0)
        moving = _irradiance(clip, TunedConfig(), ClipState())
        progress(f"moving emitters, {clip.name}", 0.3)
        truth = _irradiance(clip, fine, ClipState())
        for layer in (name for name, images in truth.items() if images.any()):
            about = f"its own change with {REFERENCE_VPLS} discs, which is subtracted"
            own = _change(truth[layer])
            name = f"flicker_{clip.name}_{layer}"
            found.append(Row(name, _change(moving[layer]) - own, "of mean per frame", about, own))
        progress(f"moving emitters, {clip.name}", 0.8)
        still = _irradiance(clip, TunedConfig(), None)
        late = _half_way(moving) - _half_way(still)
        found.append(Row(f"delay_{clip.name}", max(0, late), "frames", "stills of the same moments", 0))
    return found


def carried_panel() -> Clip:
    """The panel is carried along the room, tilting from side to side."""
    scene, panel = _with_panel(room_and_hall())
    transforms = []
    for share in np.linspace(0.0, 1.0, FRAMES):
        angle = 0.3 * np.sin(2.0 * np.pi * share)
        placed = np.eye(4)
        placed[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
        placed[:3, 3] = [0.6 * np.sin(2.0 * np.pi * share), 2.1, 4.2 - 3.4 * share]
        transforms.append(_placed(scene, panel, placed))
    return Clip("panel", scene, _view([0.9, 1.5, 4.7], [-0.3, 0.9, 0.0]), tuple(transforms))


def opened_door() -> Clip:
    """The panel stands in the hall, and a door that shuts off the room turns by 80 degrees."""
    scene, panel = _with_panel(room_and_hall())
    scene, door = _with_part(
        scene, "door", [[[0, 0, 0], [1, 0, 0], [0, 2, 0]]], Material("door", _color(0.6))
    )
    at_rest = np.eye(4)
    # It faces the door.
    at_rest[:3] = [[1, 0, 0, 0], [0, 0, 1, 1.2], [0, -1, 0, -3]]
    transforms = []
    for share in np.linspace(0.0, 1.0, FRAMES):
        angle = np.radians(80.0) * share
        turned = np.eye(4)
        turned[0, :3], turned[2, :3] = [np.cos(angle), 0, np.sin(angle)], [-np.sin(angle), 0, np.cos(angle)]
        turned[:3, 3] = [-0.5, 0.0, -0.07]
        transforms.append(_placed(scene, panel, at_rest, door, turned))
    return Clip("door", scene, _view([-1.2, 1.6, 0.6], [0.6, 0.9, 4.5]), tuple(transforms))


def _with_panel(scene: Scene) -> tuple[Scene, int]:
    panel = Material("panel", _color(0.0), emission=(RADIANCE, RADIANCE, RADIANCE))
    return _with_part(scene, "panel", [[[-0.3, 0, -0.3], [0.6, 0, 0], [0, 0, 0.6]]], panel)


def _with_part(scene: Scene, name: str, corners: list, material: Material) -> tuple[Scene, int]:
    """The scene with one part more, and the number of its instance."""
    mesh = parallelograms(name, np.array(corners, np.float64), len(scene.materials))
    instance = Instance(name, len(scene.meshes), np.eye(4))
    grown = replace(
        scene,
        materials=(*scene.materials, material),
        meshes=(*scene.meshes, mesh),
        instances=(*scene.instances, instance),
    )
    return grown, len(scene.instances)


def _color(albedo: float) -> Float32[np.ndarray, "3"]:
    return np.full(3, albedo, np.float32)


def _placed(scene: Scene, *moved: int | Float64[np.ndarray, "4 4"]) -> Float64[np.ndarray, "instances 4 4"]:
    """Transforms of all instances; `moved` are numbers of instances, each with its own after it."""
    transforms = np.array([instance.to_world for instance in scene.instances])
    for index, transform in zip(moved[::2], moved[1::2], strict=True):
        transforms[index] = transform
    return transforms


def _view(eye: list[float], target: list[float]) -> View:
    return View("moving", "fitted", SIZE, Camera(look_at(np.array(eye), np.array(target)), 1.1), ())


def _irradiance(
    clip: Clip, config: TunedConfig, state: ClipState | None
) -> dict[str, Float32[np.ndarray, "frames height width 3"]]:
    """Direct and reflected irradiance [W/m²] of each frame; stills if `state` is None."""
    runtime = Runtime(clip.scene)
    images: dict[str, list] = {"direct": [], "reflected": []}
    for transforms in clip.transforms:
        runtime.pose(Pose(transforms, np.zeros((0, 4, 4)), (), ()))
        frame = runtime.draw(clip.view, config, state).capture(maps=False)
        images["direct"].append(frame.direct_irradiance)
        images["reflected"].append(frame.indirect_irradiance)
    return {layer: np.stack(every) for layer, every in images.items()}


def _half_way(images: dict[str, Float32[np.ndarray, "frames height width 3"]]) -> int:
    """The first frame with half of the last frame's light."""
    light = sum(images.values(), np.zeros(1)).mean(axis=(1, 2, 3))
    return int(np.argmax(light >= 0.5 * light[-1]))


def _change(images: Float32[np.ndarray, "frames height width 3"]) -> float:
    return float(np.abs(np.diff(images, axis=0)).mean() / images.mean())


def _write_clip(path: Path, clip: Clip) -> None:
    runtime, config, state = Runtime(clip.scene), TunedConfig(), ClipState()
    view = replace(clip.view, size=CLIP_SIZE)
    runtime.pose(Pose(clip.transforms[-1], np.zeros((0, 4, 4)), (), ()))
    exposure = runtime.draw(view, config).read_exposure()
    with clip_writer(path, CLIP_SIZE, CLIP_FPS) as write:
        for transforms in clip.transforms:
            runtime.pose(Pose(transforms, np.zeros((0, 4, 4)), (), ()))
            write(runtime.render(view, config, state, exposure=exposure))


if __name__ == "__main__":
    for made in (carried_panel(), opened_door()):
        _write_clip(Path(sys.argv[1]) / f"{made.name}.mp4", made)
