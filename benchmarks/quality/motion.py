"""Steadiness under motion: how much more images change from frame to frame than the light does.

A spot is swept through the gallery, and a sun stands over a courtyard whose bounds change because something
rises out of it. The figure is the mean absolute change of indirect irradiance from frame to frame, of the
mean irradiance, less that of a stand-in for the truth: the same frames with 16 times the VPLs from an RSM
with twice the resolution.

`python -m benchmarks.quality.motion FOLDER` writes the plot of every step, motion.png, and the swept spot's clip;
`python -m benchmarks.quality.motion FOLDER box` writes box.mp4, a box carried through a room, with visibility maps.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from benchmarks.harness.row import Row
from vpltune import configs
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.atomic_file import written_whole
from vpltune.renderer.files.video_file import clip_writer
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import resolve_camera_and_lights
from vpltune.renderer.scene.scene import Light, Scene
from vpltune.renderer.scene.views import View

SIZE = (96, 72)
FRAMES = 120
VPL_COUNT = 256
RSM_RESOLUTION = 1024
REFERENCE_FACTOR = 16
REFERENCE_FRAMES = 24
"""Of the sweep's: the reference's own change is the mean over that many steps, spread evenly over it."""

STEADY = RuntimeOptions()
VARIANTS = {
    "neither": RuntimeOptions(rsm_filtering=1, rsm_snapping=False),
    "snapping": RuntimeOptions(rsm_filtering=1),
    "filtering": RuntimeOptions(rsm_snapping=False),
    "both": STEADY,
}
SPOT_VARIANTS = ("neither", "filtering")
"""A spot's face follows its cone and not the bounds: there is nothing to snap."""


@dataclass(frozen=True, eq=False)
class Clip:
    """A scene in motion: what it is drawn with at each of `FRAMES` frames."""

    name: str
    variants: tuple[str, ...]
    """Of `VARIANTS`."""
    scene: Scene
    views: tuple[View, ...]
    transforms: tuple[np.ndarray, ...] | None = None
    """Of all instances, at each frame; None where nothing but the light moves."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """A row for each clip and variant: its excess change against that with neither measure."""
    found = []
    for clip in (swept_spot(), rising_bounds()):
        changes = measured_changes(clip, progress)
        truth = changes.pop("reference").mean()
        excess = {variant: float(change.mean() - truth) for variant, change in changes.items()}
        against = (
            "neither snapping nor filtering, with visibility maps"
            f" (the stand-in's own change, {truth:.4f}, taken off)"
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
    """For each variant and the reference, the mean absolute change of each step, of the mean irradiance."""
    changes = {}
    for index, name in enumerate(clip.variants):
        progress(f"motion, {clip.name}", index / (len(clip.variants) + 1))
        runtime = _runtime(clip, VARIANTS[name], 1)
        changes[name] = _changes(irradiance(runtime, clip, range(FRAMES)))
    progress(f"motion, {clip.name}", len(clip.variants) / (len(clip.variants) + 1))
    reference = _runtime(clip, STEADY, REFERENCE_FACTOR)
    steps = [_changes(irradiance(reference, clip, (start, start + 1))) for start in reference_steps()]
    return changes | {"reference": np.concatenate(steps)}


def irradiance(
    runtime: Runtime, clip: Clip, frames: range | tuple[int, ...]
) -> Float32[np.ndarray, "frames height width 3"]:
    """Indirect irradiance of some frames."""
    images = []
    for frame in frames:
        _set_pose(runtime, clip, frame)
        images.append(runtime.render(clip.views[frame], "irradiance"))
    return np.stack(images)


def reference_steps() -> list[int]:
    """The steps at which the reference is drawn: from these frames to the next."""
    return np.linspace(0, FRAMES - 2, REFERENCE_FRAMES).astype(int).tolist()


def swept_spot() -> Clip:
    """The gallery's spot goes once through its room and turns as it goes."""
    scene, view = _shipped("gallery")
    light = view.lights[0]
    low, high = scene.bounds()
    reach = 0.1 * float(np.linalg.norm(high - low))
    views = tuple(replace(view, lights=(_swept(light, reach, share),)) for share in _shares())
    return Clip("spot", SPOT_VARIANTS, scene, views)


def rising_bounds() -> Clip:
    """The courtyard's smallest part rises out of it, whose bounds double in height; the sun stands still."""
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
    path = Path(configs.__file__).parent / "scenes" / f"{name}.glb"
    scene = read_scene(path)
    camera, lights, _ = resolve_camera_and_lights(scene, path, None, None)
    return scene, View(name, "fitted", SIZE, camera, lights[:1])


def _runtime(clip: Clip, options: RuntimeOptions, factor: int) -> Runtime:
    changed = ArtistParameters().as_dict() | {"vpl_count": VPL_COUNT * factor}
    resolution = RSM_RESOLUTION * (2 if factor > 1 else 1)
    config = TunedConfig(ArtistParameters(**changed), visibility="maps")
    return Runtime(clip.scene, config, options, rsm_resolution=resolution)


def _changes(images: Float32[np.ndarray, "frames height width 3"]) -> Float32[np.ndarray, " steps"]:
    return np.abs(np.diff(images, axis=0)).mean(axis=(1, 2, 3)) / images.mean()


def write_plot(path: Path, changes: dict[str, dict[str, np.ndarray]]) -> None:
    """The change of each step, one panel for each clip, logarithmic."""
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
    """The Cornell box's smallest part is carried from side to side under its lamp."""
    scene, view = _shipped("cornell-box")
    moved = _smallest_part_moved(scene, lambda share: (0.15 * np.sin(2.0 * np.pi * share), 0.12, 0.0))
    return Clip("box", ("both",), scene, (view,) * FRAMES, moved)


def _smallest_part_moved(
    scene: Scene, offset: Callable[[float], tuple[float, float, float]]
) -> tuple[np.ndarray, ...]:
    """Transforms of all instances at each frame; `offset` is in sides of the scene's bounds."""
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
        runtime.scene_buffers.set_pose(clip.transforms[frame], np.zeros((0, 4, 4)))


def write_clip(path: Path, clip: Clip, config: TunedConfig, size: tuple[int, int] = (480, 360)) -> None:
    """A clip's final images."""
    runtime = Runtime(clip.scene, config)
    exposure = None
    with clip_writer(path, size, 30.0) as write:
        for frame, view in enumerate(clip.views):
            _set_pose(runtime, clip, frame)
            write(runtime.render(replace(view, size=size), exposure=exposure))
            exposure = runtime.exposure() if exposure is None else exposure


def _main(folder: Path) -> None:
    changes = {
        clip.name: measured_changes(clip, lambda stage, share: print(f"{stage} {share:.0%}"))
        for clip in (swept_spot(), rising_bounds())
    }
    write_plot(folder / "motion.png", changes)
    write_clip(folder / "motion.mp4", swept_spot(), TunedConfig())


if __name__ == "__main__":
    if sys.argv[2:] == ["box"]:
        write_clip(Path(sys.argv[1]) / "box.mp4", carried_box(), TunedConfig(visibility="maps"))
    else:
        _main(Path(sys.argv[1]))
