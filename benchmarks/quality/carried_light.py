"""The clip of a light that is carried from a small room through a door into a hall, drawn with `auto`."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64, UInt8

from vpltune.renderer.config.artist_parameters import ArtistParameters, parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS, AutoPrior, place_of
from vpltune.renderer.config.tuned_config import TunedConfig, read_config
from vpltune.renderer.files.image_file import write_png
from vpltune.renderer.files.video_file import clip_writer
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import RuntimeOptions
from vpltune.renderer.scene.scene import Camera, Light, Scene, look_at
from vpltune.renderer.scene.views import View
from vpltune.tuner.prior.scene_generator import room_and_hall

FRAMES = 180
FPS = 30.0
ADAPTATION_FRAMES = 15.0
VPL_COUNT = 256
SIZE = (480, 270)
PLOT_HEIGHT = 210
WAY = np.array([[0.0, 1.6, 2.5], [0.0, 1.6, -0.5], [2.5, 2.4, -12.0]])
"""Of the lamp, in the room of `room_and_hall`: from within the small room, through the door."""


@dataclass(frozen=True, eq=False)
class CarriedLight:
    """The scene, and what it is drawn with in each frame."""

    scene: Scene
    views: tuple[View, ...]


def carried_light(size: tuple[int, int] = SIZE, frames: int = FRAMES) -> CarriedLight:
    """The lamp goes through the door to the far end of the hall, and the camera goes after it."""
    views = []
    for share in np.linspace(0.0, 1.0, frames):
        place = _along(share)
        eye = _along(max(0.0, share - 0.15)) + np.array([0.0, 0.1, 1.8])
        lamp = Light("point", np.full(3, 20.0), place)
        camera = Camera(look_at(eye, place + np.array([0.0, -0.4, -2.0])), 1.2)
        views.append(View("carried", "fitted", size, camera, (lamp,)))
    return CarriedLight(room_and_hall(), tuple(views))


def _along(share: float) -> Float64[np.ndarray, "3"]:
    """A point of the way, at an even pace."""
    lengths = np.linalg.norm(np.diff(WAY, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    return np.array([np.interp(share * at[-1], at, WAY[:, axis]) for axis in range(3)])


def auto_runtime(clip: CarriedLight, prior: AutoPrior | None = None, **keywords: object) -> Runtime:
    """A runtime that eases its parameters; `prior` None takes the one that ships."""
    config = read_config("auto")
    parameters = ArtistParameters(**{**config.parameters.as_dict(), "vpl_count": VPL_COUNT})
    config = TunedConfig(parameters, visibility="maps", auto=config.auto if prior is None else prior)
    options = RuntimeOptions(interleave=4, adaptation_frames=ADAPTATION_FRAMES)
    return Runtime(clip.scene, config, options, **keywords)


def drawn_places(runtime: Runtime) -> Float64[np.ndarray, " parameters"]:
    """Where in the unit cube the last image's parameters lie."""
    values = runtime.drawn_parameters().as_dict()
    return np.array([place_of(parameter_spec(name), values[name]) for name in AUTO_PARAMETERS])


def write_carried_light(folder: Path) -> None:
    """carried_light.mp4: each image over the parameters' curves; carried_light.png: four of its frames."""
    clip = carried_light()
    runtime = auto_runtime(clip)
    images, values = [], []
    for view in clip.views:
        images.append(runtime.render(view))
        values.append([runtime.drawn_parameters().as_dict()[name] for name in AUTO_PARAMETERS])
    curves, columns = _curves(np.array(values))
    frames = []
    for image, column in zip(images, columns, strict=True):
        below = curves.copy()
        below[:, column] = (200, 30, 30)
        frames.append(np.concatenate([image, below]))
    with clip_writer(folder / "carried_light.mp4", (SIZE[0], SIZE[1] + PLOT_HEIGHT), FPS) as write:
        for frame in frames:
            write(frame)
    shown = [frames[index] for index in np.linspace(0, FRAMES - 1, 4).astype(int)]
    write_png(folder / "carried_light.png", np.concatenate(shown, axis=1))


def _curves(values: np.ndarray) -> tuple[UInt8[np.ndarray, "height width 3"], Int64[np.ndarray, " frames"]]:
    """All parameters over all frames, and the column of the plot at which each frame lies."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(SIZE[0] / 100.0, PLOT_HEIGHT / 100.0), dpi=100)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.09, 0.14, 0.72, 0.8))
    for name, curve in zip(AUTO_PARAMETERS, values.T, strict=True):
        label = f"{parameter_spec(name).symbol}  {name.rpartition('_')[2]}"
        axes.plot(curve / parameter_spec(name).default, label=label, linewidth=1.0)
    axes.set_xlim(0, len(values) - 1)
    axes.set_ylabel("of the default", fontsize=6)
    axes.tick_params(labelsize=6)
    axes.legend(fontsize=6, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    canvas.draw()
    at = axes.transData.transform(np.stack([np.arange(len(values)), np.ones(len(values))], axis=1))[:, 0]
    return np.asarray(canvas.buffer_rgba())[..., :3].copy(), np.clip(at, 0, SIZE[0] - 1).astype(np.int64)
