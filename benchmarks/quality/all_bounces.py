"""Images of all bounces against the path tracer, and what they cost beside one bounce.

The scenes are the first of the generator's from seed `REPORTED_SEED`, which chose nothing
(docs/chosen_on.md), each seen by its own camera and lights, and drawn with the default config.

relMSE is measured against the two independent halves a and b of a reference: (y − a)(y − b) in place of
(y − r)², so that the reference's own noise cancels. The pixels with the largest products, `WORST` of all,
are left out. A room whose reference has more noise than `MOST_NOISE` has no relMSE: its weights, 1/r², would
be noise too. Both light and errors are those of irradiance that was reflected. Frames of all bounces and of
one are timed in turns.

`python -m benchmarks.quality.all_bounces` prints a table of these figures, and one of choices of `WALKS` and
`LATER_SHARE`, on the scenes that chose between them. Results are written to out/all_bounces as they come, in
a folder named by a digest of the program: an interrupted run continues with the same command.
"""

import json
import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, median

import moderngl
import numpy as np
from jaxtyping import Float32

from benchmarks.harness.processor_seconds import check_software, seconds_in_turn
from benchmarks.harness.program_digest import program_digest
from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import REPORTED_SEED, REPOSITORY
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import TunedConfig
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.strict_json import strict_json
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.frame.runtime_options import DEFAULT_OPTIONS, RuntimeOptions
from vpltune.renderer.gpu.gpu_context import create_context
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View
from vpltune.tuner.metrics.relative_squared_error import relative_weight
from vpltune.tuner.prior.scene_generator import generated_name, generated_scene
from vpltune.tuner.reference import ReferenceView, noise_floor, reference_views
from vpltune.tuner.surrogate.captured_view import CapturedView

ROOMS = range(8)
"""Generated scenes that are reported. A choice: one of each kind, and three more."""
CHOOSING_SEED, CHOOSING_ROOMS = 0, (1, 2, 4, 5, 7, 8, 10, 11)
"""Scenes that chose between `CHOICES`, see docs/chosen_on.md."""
CHOICES = ((2048, 0.5), (4096, 0.5), (8192, 0.5), (4096, 0.25), (4096, 1.0))
"""Walks, and VPLs of later light for each that the config asks for."""
SIZE = (160, 120)
"""Width and height of the image in pixels. A choice."""
SAMPLES = 256
"""Samples per pixel in each half of a reference. A choice: their noise cancels."""
REPEATS = 5
"""Frames of a timing, of which the median is taken. A choice."""
WORST = 0.01
"""Share of the pixels, the worst, that relMSE leaves out; rounded up to whole pixels. A choice."""

MOST_NOISE = 0.1
"""Largest noise of a reference, see `noise_floor`, whose image has a relMSE. A choice: at 0.1, weights are a
third too large in the mean."""

ALL, ONE = TunedConfig(), TunedConfig(light=ONE_BOUNCE)


@dataclass(frozen=True)
class Effort:
    """How much is measured."""

    size: tuple[int, int] = SIZE
    samples: int = SAMPLES
    repeats: int = REPEATS


Figures = dict[str, float]
"""`energy`, ÷ the reference's, and `relmse`, absent where the reference has too much noise. A reported room
has more, see `room_figures`."""


def rows(progress: Callable[[str, float], None]) -> Iterator[Row]:
    """For each room: share of one bounce, energy, relMSE and processor time."""
    return measured_rows(progress, tuple(ROOMS), Effort())


def measured_rows(
    progress: Callable[[str, float], None], numbers: tuple[int, ...], effort: Effort
) -> Iterator[Row]:
    """The rows of some rooms of `REPORTED_SEED`; those that a former run has left are read."""
    with create_context() as context:
        for index, number in enumerate(numbers):
            name = f"{generated_name(number)}-of-{REPORTED_SEED}"
            progress(name, index / len(numbers))
            scene = generated_scene(number, REPORTED_SEED)
            figures = _kept(name, effort, lambda scene=scene: room_figures(scene, effort, context))
            yield from room_rows(name, figures)
    progress("all_bounces", 1.0)


def room_rows(name: str, figures: Figures) -> list[Row]:
    """The rows of one room."""
    errors = [figures.get(each, math.nan) for each in ("relmse", "one_bounce_relmse")]
    return [
        Row(f"{name}.one_bounce", figures["one_bounce"], "of the reference's light", "all bounces", 1.0),
        Row(f"{name}.energy", figures["energy"], "of the reference's light", "the reference", 1.0),
        Row(f"{name}.relmse", errors[0], "1", "an image of one bounce", errors[1]),
        Row(
            f"{name}.time",
            figures["seconds"],
            "s of processor time",
            "one bounce",
            figures["one_bounce_seconds"],
        ),
    ]


def room_figures(scene: Scene, effort: Effort, context: moderngl.Context) -> Figures:
    """Energy and relMSE of all bounces, the relMSE of one, its share of the reference, and both times.

    Raises:
        MachineError: a GPU draws the frames.
    """
    view, reference = _traced(scene, effort, None)
    _, one_bounce = _traced(scene, effort, 1)
    runtime = Runtime(scene, context=context)
    check_software(runtime, "all_bounces")
    drawn = _score(runtime, ALL, view, reference)
    alone = _score(runtime, ONE, view, reference)
    seconds = seconds_in_turn({"all": (runtime, view, ALL), "one": (runtime, view, ONE)}, effort.repeats)
    share = one_bounce.irradiance[reference.valid].mean() / reference.irradiance[reference.valid].mean()
    return {
        **drawn,
        **({"one_bounce_relmse": alone["relmse"]} if "relmse" in alone else {}),
        "one_bounce": float(share),
        "seconds": seconds["all"],
        "one_bounce_seconds": seconds["one"],
    }


def choices(
    progress: Callable[[str, float], None],
    numbers: tuple[int, ...] = CHOOSING_ROOMS,
    effort: Effort | None = None,
) -> dict[tuple[int, float], list[Figures]]:
    """Energy and relMSE of the rooms that choose, with each of `CHOICES`; former results are read."""
    effort = effort or Effort()
    found: dict[tuple[int, float], list[Figures]] = {choice: [] for choice in CHOICES}
    with create_context() as context:
        for index, number in enumerate(numbers):
            scene = generated_scene(number, CHOOSING_SEED)
            for part, (walks, share) in enumerate(CHOICES):
                name = f"{scene.name}-of-{CHOOSING_SEED}-{walks}-{share}"
                progress(name, (index + part / len(CHOICES)) / len(numbers))
                options = RuntimeOptions(walks=walks, later_share=share)
                found[walks, share].append(
                    _kept(
                        name,
                        effort,
                        lambda scene=scene, options=options: choice_figures(scene, effort, context, options),
                    )
                )
    return found


def choice_figures(
    scene: Scene, effort: Effort, context: moderngl.Context, options: RuntimeOptions = DEFAULT_OPTIONS
) -> Figures:
    """Energy and relMSE of all bounces with these options."""
    view, reference = _traced(scene, effort, None)
    return _score(Runtime(scene, options, context=context), ALL, view, reference)


def trimmed_relmse(
    image: Float32[np.ndarray, "pixels 3"],
    half_a: Float32[np.ndarray, "pixels 3"],
    half_b: Float32[np.ndarray, "pixels 3"],
) -> float:
    """relMSE against two independent halves, without the noise of either and without the worst pixels."""
    y, a, b = (values.astype(np.float64) for values in (image, half_a, half_b))
    errors = (relative_weight((a + b) / 2.0) * y.size * (y - a) * (y - b)).mean(axis=1)
    return float(np.sort(errors)[: len(errors) - int(np.ceil(WORST * len(errors)))].mean())


def room_table(made: list[Row]) -> str:
    """A Markdown table: least, median and greatest figure of all rooms."""
    shown: dict[str, tuple[str, Callable[[Row], float], int]] = {
        "one bounce has of all light": ("one_bounce", lambda row: row.value, 2),
        "energy, all bounces ÷ reference": ("energy", lambda row: row.value, 2),
        "relMSE, all bounces": ("relmse", lambda row: row.value, 4),
        "relMSE, one bounce": ("relmse", lambda row: row.against_value, 4),
        "time ÷ one bounce": ("time", lambda row: row.ratio, 2),
    }
    lines = ["| | least | median | greatest |", "|---|---|---|---|"]
    for label, (figure, of, digits) in shown.items():
        every = [of(row) for row in made if row.name.endswith(f".{figure}")]
        values = [value for value in every if not math.isnan(value)]
        cells = " | ".join(f"{each:.{digits}f}" for each in (min(values), median(values), max(values)))
        lines.append(f"| {label} | {cells} |")
    return "\n".join(lines)


def choice_table(found: dict[tuple[int, float], list[Figures]]) -> str:
    """A Markdown table: mean relMSE and range of the energy with each choice."""
    lines = ["| walks | later discs ÷ first | relMSE, mean | energy |", "|---|---|---|---|"]
    for (walks, share), rooms in found.items():
        energies = [room["energy"] for room in rooms]
        errors = [room["relmse"] for room in rooms if "relmse" in room]
        lines.append(
            f"| {walks:,} | {share:g} | {fmean(errors):.4f} | {min(energies):.3f} … {max(energies):.3f} |"
        )
    return "\n".join(lines)


def _traced(scene: Scene, effort: Effort, bounces: int | None) -> tuple[View, ReferenceView]:
    """The scene's own view, and its reference."""
    view = View(scene.name, "fitted", effort.size, scene.cameras[0], scene.lights)
    (reference,) = reference_views(
        scene, (view,), noise_target=0.0, max_samples=effort.samples, bounces=bounces
    )
    return view, reference


def _score(runtime: Runtime, config: TunedConfig, view: View, reference: ReferenceView) -> Figures:
    captured = runtime.capture(view, config, maps=False)
    seen = CapturedView(view, reference, captured).valid
    image = captured.indirect_irradiance[seen]
    energy = image.mean(dtype=np.float64) / reference.irradiance[seen].mean(dtype=np.float64)
    figures = {"energy": float(energy)}
    if noise_floor(reference) <= MOST_NOISE:
        halves = reference.irradiance_a[seen], reference.irradiance_b[seen]
        figures["relmse"] = trimmed_relmse(image, *halves)
    return figures


def _kept(name: str, effort: Effort, measure: Callable[[], Figures]) -> Figures:
    """What `measure` returns, or what a former run has left of it."""
    width, height = effort.size
    folder = REPOSITORY / "out" / "all_bounces" / program_digest(Path(__file__))
    path = folder / f"{name}-{width}x{height}-{effort.samples}.json"
    if path.exists():
        return json.loads(path.read_text(encoding="utf-8"))
    figures = measure()
    write_text_whole(path, strict_json(figures) + "\n")
    return figures


if __name__ == "__main__":

    def _progress(stage: str, share: float) -> None:
        print(f"{share:.0%} {stage}", file=sys.stderr)

    print(room_table(list(rows(_progress))), choice_table(choices(_progress)), sep="\n\n")
