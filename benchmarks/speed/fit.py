"""How long a fit takes: the shipped Cornell box with a cold and a warm reference cache, and one step."""

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
from benchmarks.harness.scene_library import REPOSITORY
from vpltune.tuner.metrics.relative_squared_error import target_of, weighted_squared_error
from vpltune.tuner.surrogate.reduced_gather import ReducedGather, reduce_gather, reduced_image
from vpltune.tuner.surrogate.tabulated_gather import gather_tabulated, tabulate_gather
from vpltune.tuner.surrogate.virtual_point_lights import Receivers, VirtualPointLights
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather_pairwise

COLD_LIMIT_S = 60.0
WARM_LIMIT_S = 10.0
RECEIVERS = 16_384
VPLS = 1_024
REPEATS = 20


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """`fit_cold_s`, `fit_warm_s`: the whole command, Python's start included. `step_vs_pairwise`: one value
    and gradient of the loss for 16,384 receivers and 1,024 VPLs, tabulated and reduced against by pairs."""
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
    """Wall time of `vpltune fit` on the Cornell box with its caches in `folder`."""
    scene = REPOSITORY / "configs" / "scenes" / "cornell-box.glb"
    command = [sys.executable, "-m", "vpltune", "fit", str(scene), "-o", str(folder / "out"), "--json"]
    started = time.perf_counter()
    finished = subprocess.run(
        command, env={**os.environ, "VPLTUNE_CACHE": str(folder / "cache")}, capture_output=True, check=True
    )
    seconds = time.perf_counter() - started
    if json.loads(finished.stdout)["status"] not in ("improved", "kept"):
        raise RuntimeError(f"the fit did not end well: {finished.stdout.decode()}")
    return seconds


def _step_milliseconds() -> tuple[float, float]:
    """Median milliseconds of one value and gradient, reduced and pairwise, taken in turn."""
    receivers, vpls = corner(np.random.default_rng(0), RECEIVERS, VPLS)
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
    # The first of each compiles.
    return float(np.median(times["reduced"][1:])), float(np.median(times["pairwise"][1:]))


def corner(
    random: np.random.Generator, receiver_count: int, vpl_count: int
) -> tuple[Receivers, VirtualPointLights]:
    """Receivers on a floor, VPLs on the two walls that meet it, all of size 2 L."""
    floor = np.concatenate(
        [random.uniform(0.0, 2.0, (receiver_count, 2)), np.zeros((receiver_count, 1))], axis=1
    )
    wall = np.concatenate([np.zeros((vpl_count, 1)), random.uniform(0.0, 2.0, (vpl_count, 2))], axis=1)
    on_other = np.arange(vpl_count) % 2 == 1
    wall[on_other] = wall[on_other][:, [1, 0, 2]]
    normals = np.where(on_other[:, None], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0])
    flux = random.uniform(0.5, 1.5, (vpl_count, 3)) / vpl_count
    footprint = np.sqrt(8.0 / vpl_count / np.pi) * random.uniform(0.5, 2.0, vpl_count)

    def array(values: np.ndarray) -> jax.Array:
        return jnp.asarray(values, jnp.float32)

    up = np.tile([0.0, 0.0, 1.0], (receiver_count, 1))
    return (
        Receivers(array(floor), array(up)),
        VirtualPointLights(array(wall), array(normals), array(footprint), array(flux)),
    )
