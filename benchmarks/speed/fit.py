"""How long a fit takes: the shipped Cornell box with an empty and a filled cache, and one step of a fit."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import own_scene
from benchmarks.speed.lit_corner import lit_corner
from vpltune.tuner.metrics.relative_squared_error import target_of, weighted_squared_error
from vpltune.tuner.surrogate.reduced_gather import ReducedGather, reduce_gather, reduced_image
from vpltune.tuner.surrogate.tabulated_gather import gather_tabulated, tabulate_gather
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather_pairwise

COLD_LIMIT_S = 60.0
"""Seconds for a scene that was never fitted. A choice: a minute is short enough to wait for."""
WARM_LIMIT_S = 10.0
"""Seconds once references and compiled functions are cached. A choice: fits are repeated while one works."""
RECEIVERS = 16_384
"""Receivers of the timed step: four times those that a fit takes from one view."""
VPLS = 1_024
"""VPLs of the timed step: twice the default count."""
REPEATS = 20
"""Runs of the reduced step, and a fifth as many of the pairwise one. A choice."""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Seconds of a fit against limits, and milliseconds of a step against a step over all pairs.

    `fit_cold_s` and `fit_warm_s` time the whole command, including the start of Python. `step_vs_pairwise`
    times the loss and its gradient for 16,384 receivers and 1,024 VPLs: from the reduced least-squares
    problem, against a sum over all pairs of receiver and VPL.
    """
    progress("fit", 0.0)
    with tempfile.TemporaryDirectory() as folder:
        cold = _fit_seconds(Path(folder))
        progress("fit", 0.4)
        warm = _fit_seconds(Path(folder))
    progress("fit", 0.6)
    reduced, pairwise = _step_milliseconds()
    progress("fit", 1.0)
    return [
        Row("fit_cold_s", cold, "s", "limit", COLD_LIMIT_S),
        Row("fit_warm_s", warm, "s", "limit", WARM_LIMIT_S),
        Row("step_vs_pairwise", reduced, "ms", "pairwise step", pairwise),
    ]


def _fit_seconds(folder: Path) -> float:
    """Run `vpltune fit` on the Cornell box with its caches in `folder`, and return its wall-clock seconds."""
    scene = str(own_scene("cornell-box"))
    command = [
        sys.executable,
        "-m",
        "vpltune",
        "fit",
        scene,
        "-o",
        str(folder / "out"),
        "--bounces",
        "1",
        "--json",
    ]
    started = time.perf_counter()
    finished = subprocess.run(
        command, env={**os.environ, "VPLTUNE_CACHE": str(folder / "cache")}, capture_output=True, check=True
    )
    seconds = time.perf_counter() - started
    if json.loads(finished.stdout)["status"] not in ("improved", "kept"):
        raise RuntimeError(f"the fit ended neither improved nor kept: {finished.stdout.decode()}")
    return seconds


def _step_milliseconds() -> tuple[float, float]:
    """Median milliseconds of the loss and its gradient, reduced and pairwise; the two are timed in turns."""
    receivers, vpls = lit_corner(np.random.default_rng(0), RECEIVERS, VPLS)
    start = FalloffParameters(*map(jnp.float32, (1.0, 0.5, 0.1)))
    table = tabulate_gather(receivers, vpls)
    truth = np.asarray(gather_tabulated(table, FalloffParameters(*map(jnp.float32, (0.8, 1.0, 0.3)))))
    target = target_of(truth, truth)

    def reduced_loss(parameters: FalloffParameters, reduced: ReducedGather) -> jax.Array:
        return jnp.sum((reduced_image(reduced, parameters) - reduced.target) ** 2) + reduced.offset

    def pairwise_loss(parameters: FalloffParameters, pair: tuple[Receivers, VirtualPointLights]) -> jax.Array:
        return weighted_squared_error(gather_pairwise(*pair, parameters), target)

    steps = {
        "reduced": (jax.jit(jax.value_and_grad(reduced_loss)), reduce_gather(table, target)),
        "pairwise": (jax.jit(jax.value_and_grad(pairwise_loss)), (receivers, vpls)),
    }
    times: dict[str, list[float]] = {name: [] for name in steps}
    for repeat in range(REPEATS):
        for name, (step, data) in steps.items():
            if name == "pairwise" and repeat % 5:
                continue
            started = time.perf_counter()
            jax.block_until_ready(step(start, data))
            times[name].append(1e3 * (time.perf_counter() - started))
    # The first run of each compiles.
    return float(np.median(times["reduced"][1:])), float(np.median(times["pairwise"][1:]))
