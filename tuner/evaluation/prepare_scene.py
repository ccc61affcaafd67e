"""Prepares a scene for `fit` and `evaluate`: views, their references, and the runtime's buffers."""

import hashlib
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from vpltune.renderer.config.light_settings import LightSettings
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.errors import InputError
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.files import read_scene
from vpltune.renderer.scene.files.reading_border import read_at_border
from vpltune.renderer.scene.placement import named_cameras, resolve_camera_and_lights, views_for_scene
from vpltune.renderer.scene.placement.given_sky import GivenSky
from vpltune.renderer.scene.placement.scene_sidecar import completed_camera_and_lights
from vpltune.renderer.scene.placement.scene_sky import with_environment
from vpltune.renderer.scene.scene import Camera, Light, Scene
from vpltune.renderer.scene.views import SPLITS, View
from vpltune.renderer.scene.working_scale import require_drawable
from vpltune.tuner.reference import ReferenceView, reference_views
from vpltune.tuner.surrogate.captured_view import CapturedView, capture_views
from vpltune.tuner.surrogate.compiled_functions import keep_compiled_functions

Progress = Callable[[str, float], None]
"""Called with the name of a stage and the share of it that is done, in [0, 1]."""

VIEW_SIZE = (64, 48)
"""Default width and height of views, in pixels. A choice: many small views carry more information than few
large ones, because errors of neighbouring pixels are correlated and a view's time goes into its visibility
maps, whatever its size."""
LEAST_VALIDATION = 3
"""Least number of validation views. A choice: the spread between two says very little."""
NOISE_TARGET = 5e-4
"""Noise floor, in relMSE, at which a reference is done. A choice: 2 % of a pixel's irradiance."""
MAX_SAMPLES = 4096
"""Samples per pixel and half at which a reference is done at the latest. A choice."""


@dataclass(frozen=True, eq=False)
class SceneOptions:
    """How a scene is prepared."""

    views: int = 4
    """Number of fitted views. As many views, but at least `LEAST_VALIDATION`, validate a fit."""
    held_out: int | None = None
    """Number of held-out views; None takes half as many as are fitted, but at least one."""
    seed: int = 0
    camera: Camera | None = None
    """Replaces the camera of the file, of its sidecar or of the automatic placement."""
    camera_name: str | None = None
    """A camera of the file by name or number, or `all` of them, which then share the views."""
    light: Light | None = None
    """Replaces the lights of the file, of its sidecar or of the automatic placement."""
    sky: GivenSky | None = None
    """Replaces the environment of the file or of its sidecar."""
    size: tuple[int, int] = VIEW_SIZE
    """Width and height of the views, in pixels."""
    fixed_views: tuple[View, ...] | None = None
    """Uses exactly these views; `views`, `held_out`, `camera`, `light` and `size` are then ignored."""
    split_error: bool = False
    """Whether to split the tuned error by cause, which draws some more frames."""


@dataclass
class Stopwatch:
    """Measures the seconds that each stage takes."""

    seconds: dict[str, float] = field(default_factory=dict)
    """Seconds so far, by stage."""
    started: float = field(default_factory=time.perf_counter)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Add the time of the block to stage `name`."""
        before = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - before

    def report(self) -> dict[str, float]:
        """Seconds of each stage, and `total` since the stopwatch was created."""
        return {**self.seconds, "total": time.perf_counter() - self.started}


@dataclass(frozen=True, eq=False)
class PreparedScene:
    """A scene ready to be fitted or measured."""

    scene: Scene
    runtime: Runtime
    views: tuple[CapturedView, ...]
    """The fitted and held-out views, captured with the config that the scene was prepared with."""
    validation: tuple[tuple[View, ReferenceView], ...]
    """The validation views with their references; empty unless `prepare_scene` was asked for them."""
    notes: tuple[str, ...]
    """Remarks for the user: what was ignored in the file, and which camera and light were chosen."""
    file_sha256: str | None
    """Hex SHA-256 of the scene file when it was read: a fit takes minutes. None for a scene in memory."""


def prepare_scene(
    source: Path | Scene,
    options: SceneOptions,
    config: TunedConfig,
    watch: Stopwatch,
    progress: Progress,
    *,
    validated: bool = False,
    look_first: Callable[[Runtime, tuple[View, ...]], None] = lambda runtime, views: None,
) -> PreparedScene:
    """Read a scene, place its views, render their references, and capture the runtime's buffers.

    Args:
        source: a scene file, or a scene in memory, which has no sidecar.
        options: views, references, camera and light.
        config: drawn in the fitted and held-out views.
        watch: measures the stages "load", "reference" and "capture".
        progress: called with the name of a stage and the share of it that is done, in [0, 1].
        validated: whether to place validation views too, which cost a reference each, and to measure the
            statistics that a prior reads.
        look_first: called before any reference is rendered; it may refuse what the fit could not do.

    Raises:
        InputError: the scene or its sidecar cannot be used, or `look_first` refuses.
        MachineError: there is no OpenGL 4.5, or the GPU ran out of memory.
    """
    keep_compiled_functions()
    with watch.stage("load"):
        progress("load", 0.0)
        digest = None
        if isinstance(source, Path):
            scene = with_environment(read_scene(source), source, options.sky)
            with source.open("rb") as file:
                digest = hashlib.file_digest(file, "sha256").hexdigest()
        else:
            scene = with_environment(_required_drawable(source), None, options.sky)
        views, notes = _views(scene, source, options, validated)
        # Before the references, so that a machine without OpenGL fails at once.
        runtime = Runtime(scene)
        look_first(runtime, views)
    with watch.stage("reference"):
        references = references_of(
            scene, views, options.seed, config.light, lambda share: progress("reference", share)
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
    return PreparedScene(scene, runtime, tuple(captured), validation, (*scene.warnings, *notes), digest)


def references_of(
    scene: Scene,
    views: tuple[View, ...],
    seed: int,
    light: LightSettings,
    progress: Callable[[float], None] | None = None,
) -> tuple[ReferenceView, ...]:
    """References of `views` at the noise target of fits and evaluations, from the cache if they are there.

    They have the light that `light` asks for. `progress` is called with the share of all views done, in
    [0, 1].
    """
    return reference_views(
        scene,
        views,
        seed=seed,
        noise_target=NOISE_TARGET,
        max_samples=MAX_SAMPLES,
        bounces=light.most_bounces,
        progress=None if progress is None else lambda _view, share: progress(share),
    )


def _required_drawable(scene: Scene) -> Scene:
    """The scene, checked as the readers check theirs."""
    return read_at_border(f"scene {scene.name!r:.80}", lambda: scene)


def _views(
    scene: Scene, source: Path | Scene, options: SceneOptions, validated: bool
) -> tuple[tuple[View, ...], tuple[str, ...]]:
    own = options.fixed_views
    if own is not None and all(view.split != "fitted" for view in own):
        raise InputError("views: at least one must have the split 'fitted'")
    for view in own or ():
        require_drawable(view.lights, scene, f"view {view.name!r:.60}")
    if own is not None and not validated:
        return tuple(view for view in own if view.split in ("fitted", "held_out")), ()
    if own is not None:
        more = _further_views(scene, own, options.seed)
        lacking = dict.fromkeys(view.split.replace("_", " ") for view in more)
        notes = [
            f"none of the views given is {split}: such views are placed automatically" for split in lacking
        ]
        return (*own, *more), tuple(notes)
    cameras = (options.camera,)
    if options.camera_name is not None:
        cameras = named_cameras(scene, options.camera_name)
    fitted = max(1, options.views // len(cameras))
    held_out = max(1, options.views // 2) if options.held_out is None else options.held_out
    validation = max(options.views, LEAST_VALIDATION) if validated else 0
    views, notes = [], []
    for each in cameras:
        given = None if options.light is None else (options.light,)
        if isinstance(source, Path):
            camera, lights, own_notes = resolve_camera_and_lights(scene, source, each, given)
        else:
            camera, lights, own_notes = completed_camera_and_lights(scene, scene.name, each, given)
        views += views_for_scene(
            scene,
            camera,
            lights,
            fitted=fitted,
            validation=-(-validation // len(cameras)),
            held_out=-(-held_out // len(cameras)),
            size=options.size,
            seed=options.seed,
        )
        notes += own_notes
    return _renamed(views), tuple(dict.fromkeys(notes))


def _further_views(scene: Scene, own: tuple[View, ...], seed: int) -> tuple[View, ...]:
    """Views around the first fitted one of the user's own, of each split that these lack."""
    given = {view.split for view in own}
    first = next(view for view in own if view.split == "fitted")
    placed = views_for_scene(
        scene,
        first.camera,
        first.lights,
        fitted=1,
        validation=LEAST_VALIDATION,
        held_out=1,
        size=first.size,
        seed=seed,
    )
    return tuple(view for view in placed if view.split not in given)


def _renamed(views: list[View]) -> tuple[View, ...]:
    """The views of several cameras, sorted by split, each with a name of its own."""
    named = []
    for split in SPLITS:
        of_split = [view for view in views if view.split == split]
        named += [replace(view, name=f"{split}_{index}") for index, view in enumerate(of_split)]
    return tuple(named)
