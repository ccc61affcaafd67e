"""What the server asks of its processes, and what they answer. All of it is pickled."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import with_environment
from vpltune.renderer.scene.scene import Camera, Light, Scene
from vpltune.renderer.scene.views import View
from vpltune.window.document import NamedView, PlacedLight
from vpltune.window.messages import Pane, Source, WindowLayer


@dataclass(frozen=True, eq=False)
class SceneSource:
    """Where a window's scene comes from: a file, or a scene in memory."""

    path: Path | None = None
    scene: Scene | None = None
    camera: Camera | None = None
    """Where to begin; None takes the camera of the sidecar or of the scene, or places one."""
    lights: tuple[Light, ...] | None = None
    """None takes those of the sidecar or of the scene, or places one."""

    def read(self) -> Scene:
        """The scene, read from its file or as it is in memory.

        Raises:
            InputError: the file cannot be used.
        """
        if self.scene is not None:
            return self.scene
        assert self.path is not None, "a source has a file or a scene"
        return with_environment(read_scene(self.path), self.path)

    @property
    def name(self) -> str:
        """The file as it was given, or the scene's own name."""
        return str(self.path) if self.path is not None else "" if self.scene is None else self.scene.name


@dataclass(frozen=True, eq=False)
class SceneCard:
    """What the server, which holds no scene, knows of one."""

    name: str
    bounds: tuple[tuple[float, ...], tuple[float, ...]]
    """Low and high corner in world units."""
    seconds: float
    """Length of the longest clip of the animation; 0 without one."""
    renderer: str
    """OpenGL's name of what draws."""
    camera: Camera
    lights: tuple[PlacedLight, ...]
    views: tuple[NamedView, ...]
    """The cameras of the file."""
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class DrawRequest:
    """One image."""

    client: int
    pane: Pane
    source: Source
    look: int
    view: View
    """In the size to draw; lights as in the rest pose."""
    follows: tuple[int | None, ...]
    """For each light of the view, the light of the file whose animation it takes part in."""
    config: TunedConfig
    """For an error, the config that the error is of."""
    layer: WindowLayer
    seconds: float | None
    settled: bool
    """Draws a still; else a frame of this client's clip."""
    reference: Path | None = None
    """A file with the reference of the view, where the source needs one and it is there."""


@dataclass(frozen=True, eq=False)
class DrawnImage:
    """The answer to a `DrawRequest`."""

    request: DrawRequest
    encoded: bytes
    """A PNG where settled, else a JPEG; empty for an error without a reference."""
    milliseconds: float
    """From the request to the encoded image."""
    lights: tuple[Light, ...] | None
    """As the animation poses them; None in the rest pose."""
    parameters: dict[str, Any] | None
    """What a prior set; None without one."""


@dataclass(frozen=True, eq=False)
class PickRequest:
    """Asks for the surface at a place of an image, in [0, 1]² from the top left."""

    client: int
    id: int
    x: float
    y: float
    camera: Camera
    aspect: float
    """Width over height."""
    seconds: float | None


@dataclass(frozen=True, eq=False)
class Picked:
    """The answer to a `PickRequest`; `position` is None where nothing is seen."""

    request: PickRequest
    position: tuple[float, ...] | None
    normal: tuple[float, ...] | None
    distance: float
    """From the eye, in world units."""


@dataclass(frozen=True, eq=False)
class MeasureRequest:
    """Asks for the time of each pass of a frame."""

    client: int
    source: str
    view: View
    config: TunedConfig


@dataclass(frozen=True, eq=False)
class Measured:
    """The answer to a `MeasureRequest`."""

    request: MeasureRequest
    passes: dict[str, float]
    """Milliseconds by pass, in the order of the frame."""
    milliseconds: float
    """The whole frame, in which passes overlap."""


@dataclass(frozen=True, eq=False)
class Failed:
    """A request that could not be served, and why, in one line."""

    request: object
    reason: str


@dataclass(frozen=True, eq=False)
class ReferenceRequest:
    """Asks for the reference of a view, the sizes and samples growing until it is as good as it gets."""

    client: int
    view: View
    seconds: float | None
    follows: tuple[int | None, ...]
    bounces: int | None
    """As the config has it whose error is shown; None for all."""


@dataclass(frozen=True, eq=False)
class ReferenceStep:
    """How far a reference is."""

    request: ReferenceRequest
    share: float
    """Share of the work done, in [0, 1]; 1 is the end."""
    noise: float | None
    """relMSE of the noise of `path`."""
    path: Path | None
    """A file with the best reference so far; None if nothing new is there."""


@dataclass(frozen=True, eq=False)
class FitRequest:
    """Everything that a fit needs."""

    source: SceneSource
    start: TunedConfig
    lights: tuple[Light, ...]
    camera: Camera
    kept: tuple[NamedView, ...]
    """Views to fit beside that of the camera."""
    output: Path
    """Folder for what `vpltune fit` writes."""


@dataclass(frozen=True, eq=False)
class FitStep:
    """How far a fit is."""

    stage: str
    share: float
    """Share of the stage, in [0, 1]."""
    loss: float | None = None
    """Loss of `parameters`, on the fitted views."""
    parameters: dict[str, Any] | None = None


@dataclass(frozen=True, eq=False)
class FitEnd:
    """How a fit ended."""

    config: TunedConfig | None
    """None if it failed."""
    status: str
    sentence: str
    intervals: dict[str, tuple[float, float]]
    notes: tuple[str, ...] = ()
