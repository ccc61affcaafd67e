"""What the error of our frame costs a path tracer: processor seconds on one core for the same irradiance.

The scenes are the shipped ones and the first of the generator's from seed `SEED`, which chose nothing
(docs/chosen_on.md). Each is seen by its own camera and lights. Ours is a whole frame of the default config,
drawn by a software renderer. The peer is Mitsuba's rays without a denoiser: plain path tracing, or the
tuner's own reference estimator where that is faster. Loading the scene, compiling kernels and tracing what
the camera sees are not counted against it.

relMSE is measured against the two independent halves a and b of a converged reference: (y − a)(y − b) in
place of (y − r)², so that the reference's own noise cancels. The peer's relMSE is fitted as c/samples^p over
`SAMPLES`: p is 1 for independent samples, and more for its low-discrepancy ones. A last run at the count
that this predicts says how true it was.
"""

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.harness.processor_seconds import check_software, frame_seconds
from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import OWN_SCENES, scene_and_view
from vpltune.renderer.config.light_settings import ONE_BOUNCE
from vpltune.renderer.config.tuned_config import read_config
from vpltune.renderer.frame.runtime import Runtime
from vpltune.renderer.scene.scene import Scene
from vpltune.renderer.scene.views import View

if TYPE_CHECKING:
    from vpltune.tuner.reference.indirect_irradiance import IndirectIrradiance

SEED = 2
"""Seed of the generated scenes; those that leave 2 when divided by 3 choose nothing (docs/chosen_on.md)."""
GENERATED = 2
"""Generated scenes beside the shipped ones. A choice: a room and a hall."""
SIZE = (640, 360)
"""Width and height of the image in pixels. A choice: a ninth of 1080p, for software renderers."""
SAMPLES = (8, 32, 128)
"""Samples per pixel of the peer's timed runs. A choice: even numbers, a half for each estimate."""
ROUNDS = 2
"""Timings of each run, in turns, of which the fastest counts. A choice."""
REFERENCE_NOISE = 1e-3
"""relMSE of the reference's noise, which the halves cancel. A choice: that of a fit's references."""
REFERENCE_SAMPLES = 1024
"""Most samples per pixel in each half of the reference. A choice."""


@dataclass(frozen=True)
class Effort:
    """How much is measured."""

    size: tuple[int, int] = SIZE
    samples: tuple[int, ...] = SAMPLES
    rounds: int = ROUNDS
    reference_samples: int = REFERENCE_SAMPLES


@dataclass(frozen=True)
class TracedRun:
    """One run of a peer."""

    samples: int
    """Per pixel."""
    seconds: float
    """The processor's, so that other load on the core does not count."""
    relmse: float


@dataclass(frozen=True)
class EqualError:
    """A frame, and the run of the faster peer that reaches its error."""

    frame_seconds: float
    frame_relmse: float
    peer: str
    peer_seconds: float
    """On the line through the timed runs, at the count where the fitted relMSE is the frame's."""
    checked: TracedRun
    """A run at about that count."""


def rows(progress: Callable[[str, float], None]) -> Iterator[Row]:
    """For each scene, seconds of the faster peer against seconds of our frame; last, the median ratio."""
    return measured_rows(progress, scenes(), Effort())


def scenes() -> list[Path | int]:
    """The measured scenes: files, and numbers of generated ones."""
    return [*OWN_SCENES, *range(GENERATED)]


def measured_rows(
    progress: Callable[[str, float], None], chosen: list[Path | int], effort: Effort
) -> Iterator[Row]:
    """The rows of some scenes, then their median ratio.

    Each scene is measured in a process of its own, which may use one core alone.
    """
    ratios = []
    for index, scene in enumerate(chosen):
        name = loaded(scene, effort.size)[1].name
        progress("equal_error", index / len(chosen))
        # On all cores; the process that measures finds it in the cache.
        reference_halves(scene, effort)
        progress("equal_error", (index + 0.5) / len(chosen))
        spawn = multiprocessing.get_context("spawn")
        with one_core(), ProcessPoolExecutor(1, mp_context=spawn) as process:
            row = row_of(name, process.submit(equal_error, scene, effort).result())
        ratios.append(row.ratio)
        yield row
    progress("equal_error", 1.0)
    yield Row("equal_error.median", median(ratios), "1", "a frame of ours; median over scenes", 1.0)


def row_of(name: str, measured: EqualError) -> Row:
    """The row of one scene: the peer's seconds against the frame's."""
    run = measured.checked
    errors = f"relMSE {measured.frame_relmse:.3g}, the peer's {run.relmse:.3g} at {run.samples} samples"
    return Row(
        f"equal_error.{name}",
        measured.peer_seconds,
        "s",
        f"a frame of ours; {errors} a pixel, {measured.peer}",
        measured.frame_seconds,
    )


@contextmanager
def one_core() -> Iterator[None]:
    """Until the block ends, processes that this thread starts run on one core."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def loaded(scene: Path | int, size: tuple[int, int]) -> tuple[Scene, View]:
    """A scene, and the view of its own camera and lights."""
    from vpltune.tuner.prior.scene_generator import generated_scene

    if isinstance(scene, Path):
        return scene_and_view(scene, size)
    made = generated_scene(scene, SEED)
    return made, View(made.name, "fitted", size, made.cameras[0], made.lights)


def reference_halves(scene: Path | int, effort: Effort) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The halves of the reference's irradiance [W/m²], and which pixels see a surface."""
    from vpltune.tuner.reference import reference_views

    read, view = loaded(scene, effort.size)
    (reference,) = reference_views(
        read, (view,), seed=0, noise_target=REFERENCE_NOISE, max_samples=effort.reference_samples, bounces=1
    )
    return reference.irradiance_a, reference.irradiance_b, reference.valid


def equal_error(scene: Path | int, effort: Effort) -> EqualError:
    """Measure one scene.

    Raises:
        MachineError: a GPU draws the frames, which no core of the processor compares with.
    """
    # Read when Mitsuba is first loaded.
    os.environ["VPLTUNE_THREADS"] = "1"
    from vpltune.tuner.reference.indirect_irradiance import IndirectIrradiance
    from vpltune.tuner.reference.plain_path_tracing import PlainPathTracing
    from vpltune.tuner.reference.traced_scene import traced_scene

    read, view = loaded(scene, effort.size)
    half_a, half_b, seen = reference_halves(scene, effort)
    runtime, config = Runtime(read), replace(read_config("default"), light=ONE_BOUNCE)
    check_software(runtime, "equal_error")
    captured = runtime.capture(view, config, maps=False)
    valid = seen & captured.valid

    def error(image: np.ndarray) -> float:
        return relmse_without_noise(image[valid], half_a[valid], half_b[valid])

    traced = traced_scene(read)
    peers: dict[str, IndirectIrradiance] = {
        "plain path tracing": PlainPathTracing(traced, view),
        "the reference estimator": IndirectIrradiance(traced, view),
    }
    for peer in peers.values():
        traced_run(peer, 2, 0, error)  # compiles
    frames: list[float] = []
    runs: dict[str, list[TracedRun]] = {name: [] for name in peers}
    for round_index in range(effort.rounds):
        frames.append(frame_seconds(runtime, view, config))
        for name, peer in peers.items():
            runs[name] += [traced_run(peer, samples, 1 + round_index, error) for samples in effort.samples]
    relmse = error(captured.indirect_irradiance)
    needed = {name: count_and_seconds(runs[name], relmse) for name in peers}
    fastest = min(needed, key=lambda name: needed[name][1])
    count, seconds = needed[fastest]
    check = traced_run(peers[fastest], max(2, 2 * round(count / 2)), 1 + effort.rounds, error)
    return EqualError(min(frames), relmse, fastest, seconds, check)


def traced_run(
    peer: "IndirectIrradiance", samples: int, seed: int, error: Callable[[np.ndarray], float]
) -> TracedRun:
    """Trace `samples` per pixel, a half of them in each of the peer's two estimates."""
    start = time.process_time()
    total = np.zeros(())
    for batch in peer.batches(0, samples // 2, seed, 1):
        total = total + batch.irradiance.sum(axis=0, dtype=np.float64)
    seconds = time.process_time() - start
    return TracedRun(samples, seconds, error(total / (samples // 2 * 2)))


def count_and_seconds(runs: list[TracedRun], relmse: float) -> tuple[float, float]:
    """Samples per pixel at which the peer has this relMSE, and the seconds that they take.

    The logarithms of relMSE and samples lie on a line; so do seconds and samples, by the fastest run of each
    count. A picture needs one sample in every pixel, so that is the least.
    """
    clean = [run for run in runs if run.relmse > 0.0]
    counts, errors = [np.log(run.samples) for run in clean], [np.log(run.relmse) for run in clean]
    slope, offset = np.polyfit(counts, errors, 1)
    fastest: dict[int, float] = {}
    for run in runs:
        fastest[run.samples] = min(run.seconds, fastest.get(run.samples, run.seconds))
    line = np.polynomial.Polynomial.fit(list(fastest), list(fastest.values()), 1)
    count = max(1.0, float(np.exp((np.log(relmse) - offset) / slope)))
    # Below the first count the line may cross 0.
    return count, max(float(line(count)), fastest[min(fastest)] * min(1.0, count / min(fastest)))


def relmse_without_noise(image: np.ndarray, half_a: np.ndarray, half_b: np.ndarray) -> float:
    """relMSE of an image [pixels, 3] against two independent halves, without the noise of either."""
    from vpltune.tuner.metrics.relative_squared_error import relative_weight

    y, a, b = (values.astype(np.float64) for values in (image, half_a, half_b))
    return float((relative_weight((a + b) / 2.0) * (y - a) * (y - b)).sum())
