"""A clip that tests `--config auto`: a lamp is carried from a small room through a door into a hall.

A prior sets the parameters in every frame from what it measures of the scene. As the lamp leaves the room,
the measurements change, and the parameters must follow without a visible jump.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64, UInt8

from vpltune.renderer.config.artist_parameters import parameter_spec
from vpltune.renderer.config.auto_prior import AUTO_PARAMETERS, AutoPrior
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig, read_config
from vpltune.renderer.files.image_file import write_png
from vpltune.renderer.files.video_file import clip_writer
from vpltune.renderer.frame.capture import read_image
from vpltune.renderer.frame.clip_state import ClipState
from vpltune.renderer.frame.drawn_frame import DrawnFrame
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import Camera, Light, Scene
from vpltune.renderer.scene.transforms import look_at
from vpltune.renderer.scene.views import View
from vpltune.tuner.prior.scene_generator import room_and_hall

FRAMES = 180
"""Frames of the clip: six seconds. A choice."""
FPS = 30.0
"""Frames per second of the video file. A choice."""
ADAPTATION_FRAMES = 15.0
"""Time constant at which the parameters follow the prior, in frames: half a second at `FPS`. The default."""
INTERLEAVE = 4
"""Pixels along the side of an interleaved block. A choice."""
VPL_COUNT = 256
"""VPLs. A choice: one of the counts that the prior is trained with."""
SIZE = (480, 270)
"""Width and height of the image in pixels. A choice."""
PLOT_HEIGHT = 210
"""Height in pixels of the plot below the image. A choice."""
STILLS = 4
"""Frames of the clip that carried_light.png shows. A choice."""
CAMERA_LAG = 0.15
"""How far the camera is behind the lamp, as a share of the path. A choice."""
PATH = np.array([[0.0, 1.6, 2.5], [0.0, 1.6, -0.5], [2.5, 2.4, -12.0]])
"""Corners of the lamp's path through the scene `room_and_hall`, in world units: inside the small room, behind
the door, and at the far end of the hall."""


@dataclass(frozen=True, eq=False)
class CarriedLight:
    """A scene, and the view of each frame of the clip."""

    scene: Scene
    views: tuple[View, ...]


def carried_light(size: tuple[int, int] = SIZE, frames: int = FRAMES) -> CarriedLight:
    """Make the clip: the lamp moves along `PATH` at a constant speed, and the camera follows it."""
    views = []
    for share in np.linspace(0.0, 1.0, frames):
        place = _along(share)
        eye = _along(max(0.0, share - CAMERA_LAG)) + np.array([0.0, 0.1, 1.8])
        lamp = Light("point", np.full(3, 20.0), place)
        camera = Camera(look_at(eye, place + np.array([0.0, -0.4, -2.0])), 1.2)
        views.append(View("carried", "fitted", size, camera, (lamp,)))
    return CarriedLight(room_and_hall(), tuple(views))


def _along(share: float) -> Float64[np.ndarray, "3"]:
    """The point at a share of the path's length."""
    lengths = np.linalg.norm(np.diff(PATH, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    return np.array([np.interp(share * at[-1], at, PATH[:, axis]) for axis in range(3)])


def auto_config(prior: AutoPrior | None = None, *, rsm_resolution: int | None = None) -> TunedConfig:
    """The config of the clip, with `prior` or else the prior that ships."""
    shipped = read_config("auto")
    return TunedConfig(
        replace(shipped.parameters, vpl_count=VPL_COUNT),
        auto=shipped.auto if prior is None else prior,
        quality=Quality(
            interleave=INTERLEAVE, adaptation_frames=ADAPTATION_FRAMES, rsm_resolution=rsm_resolution
        ),
        light=ONE_BOUNCE,
    )


def drawn_places(drawn: DrawnFrame) -> Float64[np.ndarray, " parameters"]:
    """The parameters that a frame was drawn with, as places on their axes in [0, 1]; waits for the GPU."""
    values = drawn.read_parameters().as_dict()
    return np.array([parameter_spec(name).place_of(values[name]) for name in AUTO_PARAMETERS])


def write_carried_light(folder: Path) -> None:
    """Write the clip with the parameters plotted below the image, and some of its frames as an image.

    The files are carried_light.mp4 and carried_light.png.
    """
    clip, config, state = carried_light(), auto_config(), ClipState()
    runtime = Runtime(clip.scene)
    images, values = [], []
    for view in clip.views:
        drawn = runtime.draw(view, config, state)
        images.append(np.ascontiguousarray(read_image(drawn.frame.resources, "display")[..., :3]))
        parameters = drawn.read_parameters().as_dict()
        values.append([parameters[name] for name in AUTO_PARAMETERS])
    curves, columns = _curves(np.array(values))
    frames = []
    for image, column in zip(images, columns, strict=True):
        below = curves.copy()
        below[:, column] = (200, 30, 30)
        frames.append(np.concatenate([image, below]))
    with clip_writer(folder / "carried_light.mp4", (SIZE[0], SIZE[1] + PLOT_HEIGHT), FPS) as write:
        for frame in frames:
            write(frame)
    shown = [frames[index] for index in np.linspace(0, len(frames) - 1, STILLS).astype(int)]
    write_png(folder / "carried_light.png", np.concatenate(shown, axis=1))


def _curves(values: np.ndarray) -> tuple[UInt8[np.ndarray, "height width 3"], Int64[np.ndarray, " frames"]]:
    """Plot all parameters over the frames; returns the plot, and the column in it of each frame."""
    # Imported here because matplotlib takes half a second to load.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(SIZE[0] / 100.0, PLOT_HEIGHT / 100.0), dpi=100)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.09, 0.14, 0.72, 0.8))
    for name, curve in zip(AUTO_PARAMETERS, values.T, strict=True):
        label = f"{parameter_spec(name).symbol}  {name.rpartition('_')[2]}"
        axes.plot(curve / parameter_spec(name).default, label=label, linewidth=1.0)
    axes.set_xlim(0, len(values) - 1)
    axes.set_ylabel("value / default", fontsize=6)
    axes.tick_params(labelsize=6)
    axes.legend(fontsize=6, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    canvas.draw()
    at = axes.transData.transform(np.stack([np.arange(len(values)), np.ones(len(values))], axis=1))[:, 0]
    return np.asarray(canvas.buffer_rgba())[..., :3].copy(), np.clip(at, 0, SIZE[0] - 1).astype(np.int64)
