"""From a scene file to views with references and captured buffers: what `fit` and `evaluate` share."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.placement import resolve_camera_and_lights, views_for_scene
from vpltune.renderer.scene.scene import Camera, Light, Scene
from vpltune.renderer.scene.views import SPLITS, View
from vpltune.tuner.reference import ReferenceView, reference_views
from vpltune.tuner.surrogate.captured_view import CapturedView, capture_views
from vpltune.tuner.surrogate.compiled_functions import keep_compiled_functions

Progress = Callable[[str, float], None]

VIEW_SIZE = (64, 48)
"""Pixels of the fitted and measured views. More and smaller views tell more than few large ones: neighbouring
pixels err together, and a view's time goes into its VPLs' visibility maps, whatever its size."""
LEAST_VALIDATION = 3
"""Validation views at least: the spread between two says next to nothing."""
NOISE_TARGET = 5e-4
"""Noise floor, in relMSE, at which a reference is good enough: 2 % of a pixel's irradiance."""
MAX_SAMPLES = 4096
"""Samples per pixel in each half, where the noise target is not reached before."""


@dataclass(frozen=True, eq=False)
class SceneOptions:
    """What a scene is prepared with.

    camera, light: in place of what the file, its sidecar or the placement would give.
    views: how many views are fitted; as many, but at least LEAST_VALIDATION, validate a fit.
    held_out: how many views are held out; None takes half as many as are fitted, but at least one.
    fixed_views: these and no others; camera, light, views, seed and size then do not place any.
    split_error: whether to split the tuned error by cause, which draws some more frames.
    """

    views: int = 4
    held_out: int | None = None
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
    """The fitted and the held-out views, as drawn with the config that the scene was prepared with."""
    validation: tuple[tuple[View, ReferenceView], ...]
    """The views that choose between candidates, with their references; none where nothing is to be chosen."""
    notes: tuple[str, ...]
    """What was ignored in the file, and which camera and light were chosen."""


def prepare_scene(
    scene_path: Path,
    options: SceneOptions,
    config: TunedConfig,
    watch: Stopwatch,
    progress: Progress,
    *,
    validated: bool = False,
) -> PreparedScene:
    """Read, place views, render references, and capture the runtime's buffers with `config`.

    Args:
        validated: whether there are to be validation views, which cost a reference each.

    Raises:
        InputError: the scene or its sidecar cannot be used.
        MachineError: no OpenGL.
    """
    keep_compiled_functions()
    with watch.stage("load"):
        progress("load", 0.0)
        scene = read_scene(scene_path)
        views, notes = _views(scene, scene_path, options, validated)
        # Before the long work: a machine without OpenGL says so at once.
        runtime = Runtime(scene)
    with watch.stage("reference"):
        references = references_of(
            scene, views, options.seed, options.bounces, lambda share: progress("reference", share)
        )
    with watch.stage("capture"):
        progress("capture", 0.0)
        pairs = list(zip(views, references, strict=True))
        drawn = [(view, reference) for view, reference in pairs if view.split != "validation"]
        captured = []
        for index, (view, reference) in enumerate(drawn):
            captured += capture_views(runtime, config, (view,), (reference,), statistics=validated)
            progress("capture", (index + 1) / len(drawn))
    validation = tuple(pair for pair in pairs if pair[0].split == "validation")
    return PreparedScene(scene, runtime, tuple(captured), validation, (*scene.warnings, *notes))


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


def _views(
    scene: Scene, scene_path: Path, options: SceneOptions, validated: bool
) -> tuple[tuple[View, ...], tuple[str, ...]]:
    if options.fixed_views is not None:
        wanted = SPLITS if validated else ("fitted", "held_out")
        return tuple(view for view in options.fixed_views if view.split in wanted), ()
    camera, lights, notes = resolve_camera_and_lights(
        scene, scene_path, options.camera, None if options.light is None else (options.light,)
    )
    views = views_for_scene(
        scene,
        camera,
        lights,
        fitted=options.views,
        validation=max(options.views, LEAST_VALIDATION) if validated else 0,
        held_out=max(1, options.views // 2) if options.held_out is None else options.held_out,
        size=options.size,
        seed=options.seed,
    )
    return views, notes
