"""Flicker under motion: how much more the image changes from frame to frame than the true light does.

There are three clips. In the first, a spot sweeps through the gallery. In the second, a camera is carried
through it. In the third, a sun stands still over a courtyard whose bounds grow, because a part of it rises.
The figure is the mean absolute change of indirect irradiance from frame to frame, divided by the mean
irradiance, minus the same figure of a reference: the frames with `REFERENCE_VPLS` points from an RSM of twice
the resolution.

The default config is compared with that of version 0.1. Options of the RSM are compared with points, which
stir as the RSM does: clusters add movement of their own.

`python -m benchmarks.quality.motion FOLDER` writes motion.png, a plot of the change at every step, and
motion.mp4, the clip of the spot. `python -m benchmarks.quality.motion FOLDER box` writes box.mp4, in which a
box is carried through a room.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import own_scene, scene_and_view
from benchmarks.tuning.default import OLD
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.atomic_file import written_whole
from vpltune.renderer.files.video_file import clip_writer
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.animation import Pose
from vpltune.renderer.scene.scene import Light, Scene
from vpltune.renderer.scene.views import View

SIZE = (96, 72)
"""Width and height of the measured images in pixels. A choice."""
CLIP_SIZE = (480, 360)
"""Width and height of the written clips in pixels. A choice."""
CLIP_FPS = 30.0
"""Frames per second of the written clips. A choice."""
FRAMES = 120
"""Frames of a clip. A choice: four seconds at `CLIP_FPS`."""
VPL_COUNT = 256
"""VPLs of the compared images. A choice: few enough to flicker."""
RSM_RESOLUTION = 1024
"""Texels along the side of an RSM face: the runtime's own for one or two faces."""
REFERENCE_VPLS = 4096
"""VPLs of the reference. A choice: 16 times `VPL_COUNT`."""
REFERENCE_RSM_FACTOR = 2
"""Resolution of the reference's RSM over that of the compared images. A choice."""
REFERENCE_FRAMES = 24
"""Steps of the clip, evenly spread, at which the reference is drawn. A choice: the mean needs no more."""

STEADY = RuntimeOptions()


@dataclass(frozen=True)
class Variant:
    """What a clip is drawn with."""

    config: TunedConfig
    options: RuntimeOptions = STEADY
    against: str | None = None
    """Key of the variant that it is compared with; None for those that others are compared with."""


def _points(vpl_count: int, rsm_factor: int = 1) -> TunedConfig:
    """Points in place of discs, drawn by flux alone."""
    return TunedConfig(
        ArtistParameters(
            vpl_count=vpl_count, falloff_footprint=0.5, density_importance=0.0, lloyd_iterations=0
        ),
        quality=Quality(interleave=1, rsm_resolution=RSM_RESOLUTION * rsm_factor),
        light=ONE_BOUNCE,
    )


def variants() -> dict[str, Variant]:
    """All variants by name."""
    few = _points(VPL_COUNT)
    return {
        "old_default": Variant(OLD),
        "default": Variant(TunedConfig(light=ONE_BOUNCE), against="old_default"),
        "neither": Variant(few, RuntimeOptions(rsm_filtering=1, rsm_snapping=False)),
        "snapping": Variant(few, RuntimeOptions(rsm_filtering=1), "neither"),
        "filtering": Variant(few, RuntimeOptions(rsm_snapping=False), "neither"),
        "both": Variant(few, STEADY, "neither"),
    }


CAMERA_VARIANTS = ("old_default", "default")
"""Variants for the clip of the camera, which moves no RSM: options of the RSM change nothing."""
SPOT_VARIANTS = (*CAMERA_VARIANTS, "neither", "filtering")
"""Variants for the clip with the spot, whose RSM face follows its cone and not the bounds: none snaps it."""
SUN_VARIANTS = ("neither", "snapping", "filtering", "both")
"""Variants for the clip of the sun, whose RSM face follows the bounds."""
CAMERA_REACH = 0.05
"""Length of the carried camera's path, in diagonals of the scene. A choice: it stays in the room."""
CAMERA_TURN = 0.2
"""Largest angle, in radians, that the carried camera turns by. A choice."""


@dataclass(frozen=True, eq=False)
class Clip:
    """A scene in motion: its views and poses at each of `FRAMES` frames."""

    name: str
    variants: tuple[str, ...]
    """Keys of `variants()`."""
    scene: Scene
    views: tuple[View, ...]
    transforms: tuple[np.ndarray, ...] | None = None
    """Transforms of all instances at each frame; None where only the light moves."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """For each clip and variant, its change beyond the reference's, against that of another variant."""
    found = []
    for clip in clips():
        changes = measured_changes(clip, progress)
        truth = changes.pop("reference").mean()
        excess = {variant: float(change.mean() - truth) for variant, change in changes.items()}
        for variant, value in excess.items():
            against = variants()[variant].against
            if against is not None:
                about = f"{against}; the reference's own change, {truth:.4f}, is subtracted"
                name = f"motion_{clip.name}_{variant}"
                found.append(Row(name, value, "of mean per frame", about, excess[against]))
    return found


def measured_changes(
    clip: Clip, progress: Callable[[str, float], None]
) -> dict[str, Float32[np.ndarray, " steps"]]:
    """The mean absolute change of each step over the mean irradiance, by variant, and as `reference`."""
    changes = {}
    for index, name in enumerate(clip.variants):
        progress(f"motion, {clip.name}", index / (len(clip.variants) + 1))
        variant = variants()[name]
        runtime = Runtime(clip.scene, variant.options)
        changes[name] = _changes(irradiance(runtime, variant.config, clip, range(FRAMES)))
    progress(f"motion, {clip.name}", len(clip.variants) / (len(clip.variants) + 1))
    runtime, config = Runtime(clip.scene, STEADY), _points(REFERENCE_VPLS, REFERENCE_RSM_FACTOR)
    steps = [_changes(irradiance(runtime, config, clip, (start, start + 1))) for start in reference_steps()]
    return changes | {"reference": np.concatenate(steps)}


def irradiance(
    runtime: Runtime, config: TunedConfig, clip: Clip, frames: range | tuple[int, ...]
) -> Float32[np.ndarray, "frames height width 3"]:
    """Indirect irradiance [W/m²] of successive frames of a clip."""
    images, state = [], ClipState()
    for frame in frames:
        _set_pose(runtime, clip, frame)
        images.append(runtime.render(clip.views[frame], config, state, layer="irradiance"))
    return np.stack(images)


def reference_steps() -> list[int]:
    """The frames at which the steps of the reference begin."""
    return np.linspace(0, FRAMES - 2, REFERENCE_FRAMES).astype(int).tolist()


def clips() -> tuple[Clip, ...]:
    """The clips that are measured."""
    return swept_spot(), carried_camera(), rising_bounds()


def swept_spot() -> Clip:
    """The spot of the gallery moves through its room and turns on the way."""
    scene, view = _shipped("gallery")
    light = view.lights[0]
    low, high = scene.bounds()
    reach = 0.1 * float(np.linalg.norm(high - low))
    views = tuple(replace(view, lights=(_swept(light, reach, share),)) for share in _shares())
    return Clip("spot", SPOT_VARIANTS, scene, views)


def carried_camera() -> Clip:
    """The gallery's camera moves sideways by `CAMERA_REACH`, and turns from side to side by `CAMERA_TURN`."""
    scene, view = _shipped("gallery")
    low, high = scene.bounds()
    reach = CAMERA_REACH * float(np.linalg.norm(high - low))
    views = []
    for share in _shares():
        angle = CAMERA_TURN * np.sin(2.0 * np.pi * share)
        turn = np.eye(4)
        turn[:3, :3] = [[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]]
        to_world = view.camera.to_world @ turn
        to_world[:3, 3] += reach * (share - 0.5) * view.camera.to_world[:3, 0]
        views.append(replace(view, camera=replace(view.camera, to_world=to_world)))
    return Clip("camera", CAMERA_VARIANTS, scene, tuple(views))


def rising_bounds() -> Clip:
    """The smallest part of the courtyard rises until the bounds are twice as high; the sun stands still."""
    scene, view = _shipped("courtyard")
    moved = _smallest_part_moved(scene, lambda share: (0.0, 0.5 + share, 0.0))
    return Clip("sun", SUN_VARIANTS, scene, (view,) * FRAMES, moved)


def _shares() -> np.ndarray:
    return np.linspace(0.0, 1.0, FRAMES)


def _swept(light: Light, reach: float, share: float) -> Light:
    along = reach * np.array([share - 0.5, 0.0, 0.25 * np.sin(2.0 * np.pi * share)])
    turned = light.direction_world + 0.15 * np.array([np.sin(2.0 * np.pi * share), 0.0, share - 0.5])
    return replace(
        light,
        position_world=light.position_world + along,
        direction_world=turned / np.linalg.norm(turned),
    )


def _shipped(name: str) -> tuple[Scene, View]:
    scene, view = scene_and_view(own_scene(name), SIZE)
    return scene, replace(view, lights=view.lights[:1])


def _changes(images: Float32[np.ndarray, "frames height width 3"]) -> Float32[np.ndarray, " steps"]:
    return np.abs(np.diff(images, axis=0)).mean(axis=(1, 2, 3)) / images.mean()


def write_plot(path: Path, changes: dict[str, dict[str, np.ndarray]]) -> None:
    """Plot the change at each step on a logarithmic axis, with a panel for each clip."""
    # Imported here because matplotlib takes half a second to load.
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    for axes, (clip, of_clip) in zip(figure.subplots(1, len(changes)), changes.items(), strict=True):
        for name, change in of_clip.items():
            steps = reference_steps() if name == "reference" else range(len(change))
            axes.semilogy(steps, np.maximum(change, 1e-6), "k.-" if name == "reference" else "-", label=name)
        axes.set(title=clip, xlabel="frame", ylabel="mean absolute change / mean irradiance")
        axes.legend()
    with written_whole(path) as temporary:
        figure.savefig(temporary, dpi=90)


def carried_box() -> Clip:
    """The smallest part of the Cornell box is carried from side to side below the lamp."""
    scene, view = _shipped("cornell-box")
    moved = _smallest_part_moved(scene, lambda share: (0.15 * np.sin(2.0 * np.pi * share), 0.12, 0.0))
    return Clip("box", ("both",), scene, (view,) * FRAMES, moved)


def _smallest_part_moved(
    scene: Scene, offset: Callable[[float], tuple[float, float, float]]
) -> tuple[np.ndarray, ...]:
    """Transforms of all instances at each frame; `offset` gives the part's shift in sides of the bounds."""
    smallest = min(
        range(len(scene.instances)),
        key=lambda index: np.ptp(scene.meshes[scene.instances[index].mesh].positions, axis=0).max(),
    )
    low, high = scene.bounds()
    transforms = []
    for share in _shares():
        placed = np.array([instance.to_world for instance in scene.instances])
        placed[smallest, :3, 3] += (high - low) * np.array(offset(share))
        transforms.append(placed)
    return tuple(transforms)


def _set_pose(runtime: Runtime, clip: Clip, frame: int) -> None:
    if clip.transforms is not None:
        runtime.pose(Pose(clip.transforms[frame], np.zeros((0, 4, 4)), (), ()))


def write_clip(path: Path, clip: Clip) -> None:
    """Write a clip, drawn with the default config; all frames have the exposure of the first."""
    runtime, config, state = Runtime(clip.scene), TunedConfig(light=ONE_BOUNCE), ClipState()
    views = [replace(view, size=CLIP_SIZE) for view in clip.views]
    _set_pose(runtime, clip, 0)
    exposure = runtime.draw(views[0], config).read_exposure()
    with clip_writer(path, CLIP_SIZE, CLIP_FPS) as write:
        for frame, view in enumerate(views):
            _set_pose(runtime, clip, frame)
            write(runtime.render(view, config, state, exposure=exposure))


def _main(folder: Path) -> None:
    changes = {
        clip.name: measured_changes(clip, lambda stage, share: print(f"{stage} {share:.0%}"))
        for clip in clips()
    }
    write_plot(folder / "motion.png", changes)
    write_clip(folder / "motion.mp4", swept_spot())


if __name__ == "__main__":
    if sys.argv[2:] == ["box"]:
        write_clip(Path(sys.argv[1]) / "box.mp4", carried_box())
    else:
        _main(Path(sys.argv[1]))
