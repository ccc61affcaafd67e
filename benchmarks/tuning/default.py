"""The default config against the one of version 0.1, and the front of error against frame time that it is on.

Errors are those of untuned frames of `ERROR_SIZE` against the path tracer, means over `VIEWS` views, each
with its own light. Times are of frames of `TIMED_SIZE`. Scenes that chose the default are kept apart from
those that chose nothing (docs/chosen_on.md). Results are written to out/default as they come, in a folder
named by a digest of the program: an interrupted run continues with the same command. The front is plotted
in out/default/front.png.

`python -m benchmarks.tuning.default` prints the table by scene.
"""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import moderngl
import numpy as np

from benchmarks.harness.program_digest import program_digest
from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import (
    CHOOSING_SEED,
    KEPT_AWAY,
    REPORTED_SEED,
    REPOSITORY,
    present_scenes,
)
from vpltune.renderer.config.artist_parameters import ArtistParameters
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.quality import Quality
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.atomic_file import write_text_whole, written_whole
from vpltune.renderer.files.strict_json import strict_json
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.scene.placement import views_for_scene
from vpltune.renderer.scene.scene import Scene
from vpltune.tuner.metrics.view_metrics import mean_metrics
from vpltune.tuner.prior.scene_generator import generated_name, generated_scene
from vpltune.tuner.prior.train_prior import library_scene
from vpltune.tuner.reference import reference_views
from vpltune.tuner.surrogate.captured_view import CapturedView, capture_views

GENERATED = 10
"""Generated scenes of each seed, two of a kind. A choice."""
RESERVED = KEPT_AWAY
"""Scenes from files that chose nothing."""
ERROR_SIZE, TIMED_SIZE = (320, 180), (640, 360)
"""Width and height in pixels."""
VIEWS = 2
"""Views of each scene: the first of those that a fit takes, and the first held-out one. A choice."""
NOISE_TARGET, MAX_SAMPLES = 1e-3, 4096
"""Limits of the references, see `reference_views`. A choice: below the errors of the frames, of which the
least is 0.002. Noise adds to the errors of both configs, and their ratio tends to 1."""
FRAMES = 3
"""Frames of a timing, of which the median is taken. A choice."""
FIGURES = ("relmse", "trimmed_relmse", "flip", "median_error")

OLD = TunedConfig(
    ArtistParameters(falloff_footprint=0.5, vpl_count=1024, density_importance=0.0, lloyd_iterations=0),
    quality=Quality(interleave=1, map_size=24),
    light=ONE_BOUNCE,
)
"""The default of version 0.1: 1,024 points, of which every pixel gathers all."""
DEFAULT = TunedConfig(light=ONE_BOUNCE)


def _discs(**changes: Any) -> TunedConfig:
    return replace(DEFAULT, parameters=replace(DEFAULT.parameters, **changes))


FRONT: dict[str, TunedConfig] = {
    **{f"{count} discs": _discs(vpl_count=count) for count in (64, 128, 256, 1024)},
    "λ=1": _discs(lloyd_iterations=1),
    "λ=8": _discs(lloyd_iterations=8),
    "η=0": _discs(density_importance=0.0),
    "η=1": _discs(density_importance=1.0),
    **{f"maps {size}²": replace(DEFAULT, quality=Quality(map_size=size)) for size in (16, 24, 48)},
    "RSM 512²": replace(DEFAULT, quality=Quality(rsm_resolution=512)),
    "512 points": _discs(lloyd_iterations=0, falloff_footprint=0.5),
}
"""Configs between which the default (512 discs, λ = 2, η = 0.5) was chosen; each differs from it as named."""
LIMITS = {
    "time": ("milliseconds", 0.25),
    "relmse": ("relmse", 0.85),
    "trimmed": ("trimmed_relmse", 0.6),
    "flip": ("flip", 0.9),
    "median_error": ("median_error", 1.0),
}
"""Figure, and limit of its median ratio to the old default, by the row's name. A choice."""
WORST = 1.1
"""Limit of the worst scene's ratio, where that of the median is not higher. A choice."""


@dataclass(frozen=True)
class Measured:
    """One scene's figures by config: errors, and milliseconds of a frame."""

    name: str
    chose: bool
    """Whether the scene took part in the choice of the default."""
    figures: dict[str, dict[str, float]]

    def ratio(self, figure: str, config: str = "default") -> float:
        """The figure ÷ that of the old default."""
        return self.figures[config][figure] / self.figures["old"][figure]


def sources() -> dict[str, tuple[Callable[[], Scene], bool]]:
    """Name of each scene → a function that makes it, and whether it took part in the choice."""
    made: dict[str, tuple[Callable[[], Scene], bool]] = {}
    for seed, chose in ((CHOOSING_SEED, True), (REPORTED_SEED, False)):
        for number in range(GENERATED):
            name = f"{generated_name(number)}-of-{seed}"
            made[name] = (partial(generated_scene, number, seed), chose)
    for name, path in present_scenes().items():
        made[name] = (partial(library_scene, path, name), name not in RESERVED)
    return made


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Ratios of the new default to the old one, medians and worst; a row for each scene's share of beads."""
    scenes = measured({"old": OLD, "default": DEFAULT}, sources(), progress)
    return [*ratio_rows(scenes), *map(_bead_row, scenes)]


def _bead_row(scene: Measured) -> Row:
    old, new = (scene.figures[name]["off_share"] for name in ("old", "default"))
    return Row(f"{scene.name}.off_share", new, "of the pixels", "the old default", old)


def ratio_rows(scenes: list[Measured]) -> list[Row]:
    """The rows of measured scenes."""
    found = []
    for group, chosen in (("unseen", False), ("chosen_on", True)):
        of_group = [scene for scene in scenes if scene.chose == chosen]
        for name, (figure, limit) in LIMITS.items() if of_group else ():
            ratios = [scene.ratio(figure) for scene in of_group]
            about = f"limit; median over {len(of_group)} scenes"
            found.append(Row(f"{group}.{name}_ratio", median(ratios), "of the old default", about, limit))
            found.append(
                Row(
                    f"{group}.worst_{name}_ratio",
                    max(ratios),
                    "of the old default",
                    "limit",
                    max(WORST, limit),
                )
            )
        if of_group:
            new, old = (
                [scene.figures[config]["off_share"] for scene in of_group] for config in ("default", "old")
            )
            found += [
                Row(f"{group}.beads", median(new), "of the pixels", "median, the old default", median(old)),
                Row(f"{group}.worst_beads", max(new), "of the pixels", "worst, the old default", max(old)),
            ]
    return found


def measured(
    configs: dict[str, TunedConfig],
    scenes: dict[str, tuple[Callable[[], Scene], bool]],
    progress: Callable[[str, float], None],
) -> list[Measured]:
    """The figures of every lit scene with every config; those that a former run has left are read."""
    folder = REPOSITORY / "out" / "default" / program_digest(Path(__file__))
    found = []
    with create_context() as context:
        for index, (name, (make, chose)) in enumerate(scenes.items()):
            progress(name, index / len(scenes))
            path = folder / f"{name}.json"
            figures: dict[str, Any] = {}
            if path.exists():
                figures = json.loads(path.read_text(encoding="utf-8"))
            left = {each: config for each, config in configs.items() if each not in figures}
            if left:
                figures |= _figures(make(), left, context)
                write_text_whole(path, strict_json(figures) + "\n")
            if all(figures[each] for each in configs):
                found.append(Measured(name, chose, {each: figures[each] for each in configs}))
    return found


def _figures(
    scene: Scene, configs: dict[str, TunedConfig], context: moderngl.Context
) -> dict[str, dict[str, float]]:
    """Errors and milliseconds by config; empty where no indirect light arrives in a view."""
    views = views_for_scene(
        scene, scene.cameras[0], scene.lights, fitted=1, held_out=VIEWS - 1, size=ERROR_SIZE, seed=0
    )
    references = reference_views(scene, views, noise_target=NOISE_TARGET, max_samples=MAX_SAMPLES, bounces=1)
    runtime = Runtime(scene, context=context)
    figures = {}
    for name, config in configs.items():
        drawn = capture_views(runtime, config, views, references, maps=False)
        if not all(view.lit for view in drawn):
            return {name: {} for name in configs}
        mean = mean_metrics([view.metrics(view.captured.indirect_irradiance) for view in drawn]).as_dict()
        timed = replace(views[0], size=TIMED_SIZE)
        milliseconds = runtime.frame_milliseconds(timed, config, FRAMES)
        figures[name] = {
            **{each: mean[each] for each in FIGURES},
            "off_share": float(np.mean([_off_share(view) for view in drawn])),
            "milliseconds": milliseconds,
        }
    return figures


def _off_share(view: CapturedView) -> float:
    """Share of the pixels that are off by more than the reference and than its mean: beads at contacts."""
    valid = view.valid
    reference = view.reference.irradiance[valid].mean(axis=1)
    error = np.abs(view.captured.indirect_irradiance[valid].mean(axis=1) - reference)
    return float((error > np.maximum(reference, reference.mean())).mean())


def write_front(path: Path, scenes: list[Measured], names: list[str]) -> None:
    """Plot each config: median over scenes of time and trimmed relMSE, both ÷ those of the old default.

    Raises:
        InputError: the path cannot be written to.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    axes = figure.subplots()
    for name in names:
        x, y = (
            median(scene.ratio(each, name) for scene in scenes) for each in ("milliseconds", "trimmed_relmse")
        )
        axes.loglog(x, y, "o", color="black")
        axes.annotate(f" {name}", (x, y), va="bottom")
    axes.set(
        xlabel="frame time ÷ that of 1,024 points",
        ylabel="relMSE without the worst 0.1 % ÷ that of 1,024 points",
    )
    axes.margins(x=0.2)
    axes.grid(which="both", alpha=0.3)
    with written_whole(path) as temporary:
        figure.savefig(temporary, dpi=120)


def table(scenes: list[Measured], names: list[str]) -> str:
    """A Markdown table: each scene's ratios with each config, and their medians."""
    shown = (*FIGURES, "milliseconds")
    lines = ["| scene | config | " + " | ".join(shown) + " |", "|---|---|" + "---|" * len(shown)]
    for name in names:
        ratios = {figure: [scene.ratio(figure, name) for scene in scenes] for figure in shown}
        for index, scene in enumerate(scenes):
            cells = " | ".join(f"{ratios[figure][index]:.2f}" for figure in shown)
            lines.append(f"| {scene.name} | {name} | {cells} |")
        cells = " | ".join(f"{median(ratios[figure]):.3f}" for figure in shown)
        lines.append(f"| median | {name} | {cells} |")
    return "\n".join(lines)


def front(progress: Callable[[str, float], None]) -> list[Measured]:
    """Measure the whole front on the scenes that choose, and plot it."""
    choosing = {name: source for name, source in sources().items() if source[1]}
    configs = {"old": OLD, "default": DEFAULT, **FRONT}
    scenes = measured(configs, choosing, progress)
    write_front(REPOSITORY / "out" / "default" / "front.png", scenes, list(configs))
    return scenes


if __name__ == "__main__":
    print(
        table(front(lambda stage, share: print(f"{share:.0%} {stage}", file=sys.stderr)), ["default", *FRONT])
    )
