"""Flicker under motion: how much more the image changes from frame to frame than the true light does.

There are two clips. In one, a spot sweeps through the gallery. In the other, a sun stands still over a
courtyard whose bounds grow, because a part of it rises. The figure is the mean absolute change of indirect
irradiance from frame to frame, divided by the mean irradiance, minus the same figure of a reference: the
frames with 16 times the VPLs from an RSM of twice the resolution. VPLs are points, which stir as the RSM
does: clusters add movement of their own.

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
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.atomic_file import written_whole
from vpltune.renderer.files.video_file import clip_writer
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
REFERENCE_FACTOR = 16
"""VPLs of the reference over those of the compared images. A choice."""
REFERENCE_RSM_FACTOR = 2
"""The same for the RSM's resolution. A choice."""
REFERENCE_FRAMES = 24
"""Steps of the clip, evenly spread, at which the reference is drawn. A choice: the mean needs no more."""

STEADY = RuntimeOptions()
VARIANTS = {
    "neither": RuntimeOptions(rsm_filtering=1, rsm_snapping=False),
    "snapping": RuntimeOptions(rsm_filtering=1),
    "filtering": RuntimeOptions(rsm_snapping=False),
    "both": STEADY,
}
SPOT_VARIANTS = ("neither", "filtering")
"""Variants for the clip with the spot, whose RSM face follows its cone and not the bounds: none snaps it."""


@dataclass(frozen=True, eq=False)
class Clip:
    """A scene in motion: its views and poses at each of `FRAMES` frames."""

    name: str
    variants: tuple[str, ...]
    """Keys of `VARIANTS`."""
    scene: Scene
    views: tuple[View, ...]
    transforms: tuple[np.ndarray, ...] | None = None
    """Transforms of all instances at each frame; None where only the light moves."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """For each clip and variant, its change beyond the reference's, against that of the variant `neither`."""
    found = []
    for clip in (swept_spot(), rising_bounds()):
        changes = measured_changes(clip, progress)
        truth = changes.pop("reference").mean()
        excess = {variant: float(change.mean() - truth) for variant, change in changes.items()}
        against = (
            "neither snapping nor filtering, with visibility maps"
            f" (the reference's own change, {truth:.4f}, is subtracted)"
        )
        found += [
            Row(f"motion_{clip.name}_{variant}", value, "of mean per frame", against, excess["neither"])
            for variant, value in excess.items()
            if variant != "neither"
        ]
    return found


def measured_changes(
    clip: Clip, progress: Callable[[str, float], None]
) -> dict[str, Float32[np.ndarray, " steps"]]:
    """The mean absolute change of each step over the mean irradiance, by variant, and as `reference`."""
    changes = {}
    for index, name in enumerate(clip.variants):
        progress(f"motion, {clip.name}", index / (len(clip.variants) + 1))
        runtime = Runtime(clip.scene, VARIANTS[name])
        changes[name] = _changes(irradiance(runtime, _config(), clip, range(FRAMES)))
    progress(f"motion, {clip.name}", len(clip.variants) / (len(clip.variants) + 1))
    runtime, config = Runtime(clip.scene, STEADY), _config(REFERENCE_FACTOR, REFERENCE_RSM_FACTOR)
    steps = [_changes(irradiance(runtime, config, clip, (start, start + 1))) for start in reference_steps()]
    return changes | {"reference": np.concatenate(steps)}


def irradiance(
    runtime: Runtime, config: TunedConfig, clip: Clip, frames: range | tuple[int, ...]
) -> Float32[np.ndarray, "frames height width 3"]:
    """Indirect irradiance [W/m²] of some frames of a clip."""
    images = []
    for frame in frames:
        _set_pose(runtime, clip, frame)
        images.append(runtime.render(clip.views[frame], config, layer="irradiance"))
    return np.stack(images)


def reference_steps() -> list[int]:
    """The frames at which the steps of the reference begin."""
    return np.linspace(0, FRAMES - 2, REFERENCE_FRAMES).astype(int).tolist()


def swept_spot() -> Clip:
    """The spot of the gallery moves through its room and turns on the way."""
    scene, view = _shipped("gallery")
    light = view.lights[0]
    low, high = scene.bounds()
    reach = 0.1 * float(np.linalg.norm(high - low))
    views = tuple(replace(view, lights=(_swept(light, reach, share),)) for share in _shares())
    return Clip("spot", SPOT_VARIANTS, scene, views)


def rising_bounds() -> Clip:
    """The smallest part of the courtyard rises until the bounds are twice as high; the sun stands still."""
    scene, view = _shipped("courtyard")
    moved = _smallest_part_moved(scene, lambda share: (0.0, 0.5 + share, 0.0))
    return Clip("sun", tuple(VARIANTS), scene, (view,) * FRAMES, moved)


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


def _config(vpl_factor: int = 1, rsm_factor: int = 1) -> TunedConfig:
    return TunedConfig(
        ArtistParameters(
            vpl_count=VPL_COUNT * vpl_factor,
            falloff_footprint=0.5,
            density_importance=0.0,
            lloyd_iterations=0,
        ),
        quality=Quality(rsm_resolution=RSM_RESOLUTION * rsm_factor),
    )


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
    runtime, config = Runtime(clip.scene), TunedConfig()
    views = [replace(view, size=CLIP_SIZE) for view in clip.views]
    _set_pose(runtime, clip, 0)
    exposure = runtime.draw(views[0], config).read_exposure()
    with clip_writer(path, CLIP_SIZE, CLIP_FPS) as write:
        for frame, view in enumerate(views):
            _set_pose(runtime, clip, frame)
            write(runtime.render(view, config, exposure=exposure))


def _main(folder: Path) -> None:
    changes = {
        clip.name: measured_changes(clip, lambda stage, share: print(f"{stage} {share:.0%}"))
        for clip in (swept_spot(), rising_bounds())
    }
    write_plot(folder / "motion.png", changes)
    write_clip(folder / "motion.mp4", swept_spot())


if __name__ == "__main__":
    if sys.argv[2:] == ["box"]:
        write_clip(Path(sys.argv[1]) / "box.mp4", carried_box())
    else:
        _main(Path(sys.argv[1]))
