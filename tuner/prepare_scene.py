"""From a scene file to views with references and captured buffers: what `fit` and `evaluate` share."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from renderer.runtime import Runtime
from renderer.scene import Camera, Light, Scene
from renderer.scene_file import read_scene
from renderer.tuned_config import TunedConfig
from renderer.view_placement import resolve_camera_and_lights, views_for_scene
from renderer.views import View
from tuner.captured_view import CapturedView, capture_views
from tuner.compiled_functions import keep_compiled_functions
from tuner.reference import ReferenceView, reference_views

Progress = Callable[[str, float], None]

VIEW_SIZE = (128, 96)
"""Of the views that are fitted and measured: 12,288 receivers each."""
NOISE_TARGET = 1e-3
"""Noise floor, in relMSE, at which a reference is good enough: well under any model's own error."""
MAX_SAMPLES = 4096
"""Samples per pixel in each half, where the noise target is not reached before."""


@dataclass(frozen=True, eq=False)
class SceneOptions:
    """What a scene is prepared with.

    camera, light: in place of what the file, its sidecar or the placement would give.
    views: how many views are fitted; half as many, but at least one, are held out.
    fixed_views: these and no others; camera, light, views, seed and size then do not place any.
    split_error: whether to split the tuned error by cause, which draws some more frames.
    """

    views: int = 2
    seed: int = 0
    bounces: Literal["1", "all"] = "1"
    camera: Camera | None = None
    light: Light | None = None
    size: tuple[int, int] = VIEW_SIZE
    fixed_views: tuple[View, ...] | None = None
    split_error: bool = False


@dataclass
class Stopwatch:
    """Seconds spent by stage."""

    seconds: dict[str, float] = field(default_factory=dict)
    started: float = field(default_factory=time.perf_counter)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        before = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - before

    def report(self) -> dict[str, float]:
        """Seconds of every stage, and `total` since the stopwatch was made."""
        return {**self.seconds, "total": time.perf_counter() - self.started}


@dataclass(frozen=True, eq=False)
class PreparedScene:
    """A scene ready to be fitted or measured."""

    scene: Scene
    runtime: Runtime
    views: tuple[CapturedView, ...]
    notes: tuple[str, ...]
    """What was ignored in the file, and which camera and light were chosen."""


def prepare_scene(
    scene_path: Path, options: SceneOptions, config: TunedConfig, watch: Stopwatch, progress: Progress
) -> PreparedScene:
    """Read, place views, render references, and capture the runtime's buffers with `config`.

    Raises:
        InputError: the scene or its sidecar cannot be used.
        MachineError: no OpenGL.
    """
    keep_compiled_functions()
    with watch.stage("load"):
        progress("load", 0.0)
        scene = read_scene(scene_path)
        views, notes = _views(scene, scene_path, options)
        # Before the long work: a machine without OpenGL says so at once.
        runtime = Runtime(scene, config)
    with watch.stage("reference"):
        references = references_of(
            scene, views, options.seed, options.bounces, lambda share: progress("reference", share)
        )
    with watch.stage("capture"):
        progress("capture", 0.0)
        captured = capture_views(runtime, views, references)
    return PreparedScene(scene, runtime, captured, (*scene.warnings, *notes))


def references_of(
    scene: Scene,
    views: tuple[View, ...],
    seed: int,
    bounces: Literal["1", "all"],
    progress: Callable[[float], None] | None = None,
) -> tuple[ReferenceView, ...]:
    """References of `views`, as every fit and evaluation takes them."""
    return reference_views(
        scene,
        views,
        seed=seed,
        noise_target=NOISE_TARGET,
        max_samples=MAX_SAMPLES,
        bounces=1 if bounces == "1" else None,
        progress=None if progress is None else lambda _view, share: progress(share),
    )


def _views(scene: Scene, scene_path: Path, options: SceneOptions) -> tuple[tuple[View, ...], tuple[str, ...]]:
    if options.fixed_views is not None:
        return options.fixed_views, ()
    camera, lights, notes = resolve_camera_and_lights(
        scene, scene_path, options.camera, None if options.light is None else (options.light,)
    )
    views = views_for_scene(
        scene,
        camera,
        lights,
        fitted=options.views,
        held_out=max(1, options.views // 2),
        size=options.size,
        seed=options.seed,
    )
    return views, notes
