"""The surrogate's throughput against this machine's own matrix product, and its memory for many VPLs."""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.harness.row import Row
from benchmarks.harness.scene_library import REPOSITORY
from benchmarks.speed.fit import corner
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather
from vpltune.tuner.surrogate.wide_vectors import wide_jit

FLOPS_PER_PAIR = 40.0
"""Of the gather as written: a root, an exponential and two quotients counted as a few each."""
MATRIX = 2048
RECEIVERS = 16_384
VPLS = 1_024
FORWARD_AIM = 0.25
REPEATS = 9
FEW_VPLS, MANY_VPLS = 256, 16_384
MEMORY_RECEIVERS = 4_096
_PEAK = """
import sys
from benchmarks.speed.surrogate import one_gradient, peak_kibibytes
one_gradient(int(sys.argv[1]))
print(peak_kibibytes())
"""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """`forward_share_of_matmul`, `gradient_share_of_matmul`: pairs a second at 40 flop each, over the rate of
    a float32 matrix product, taken in turn. `peak_memory_16384_vpls`: a process's, against one with 256."""
    progress("surrogate", 0.0)
    seconds = _best_seconds()
    rate = 2.0 * MATRIX**3 / seconds["matmul"]
    flops = FLOPS_PER_PAIR * RECEIVERS * VPLS
    against = f"aim; {rate / 1e9:.0f} Gflop/s matmul, {{:.0f}} million pairs/s"
    made = [
        Row(
            f"{name}_share_of_matmul",
            flops / seconds[name] / rate,
            "1",
            against.format(RECEIVERS * VPLS / seconds[name] / 1e6),
            FORWARD_AIM,
        )
        for name in ("forward", "gradient")
    ]
    progress("surrogate", 0.5)
    few, many = (_peak_mebibytes(count) for count in (FEW_VPLS, MANY_VPLS))
    progress("surrogate", 1.0)
    return [*made, Row(f"peak_memory_{MANY_VPLS}_vpls", many, "MiB", f"with {FEW_VPLS} VPLs", few)]


def _best_seconds() -> dict[str, float]:
    """The best of some runs of each, taken in turn, so that a busy moment meets them all."""
    receivers, vpls = corner(np.random.default_rng(0), RECEIVERS, VPLS)
    parameters = FalloffParameters(*map(jnp.float32, (1.0, 0.5, 0.1)))
    matrix = jnp.asarray(np.random.default_rng(1).random((MATRIX, MATRIX)), jnp.float32)
    runs: dict[str, Callable[[], object]] = {
        "matmul": _bound(jax.jit(lambda a: a @ a), matrix),
        "forward": _bound(wide_jit(gather), receivers, vpls, parameters),
        "gradient": _bound(_gradient, receivers, vpls, parameters),
    }
    best = dict.fromkeys(runs, np.inf)
    for repeat in range(REPEATS + 1):
        for name, run in runs.items():
            started = time.perf_counter()
            jax.block_until_ready(run())
            # The first compiles.
            if repeat:
                best[name] = min(best[name], time.perf_counter() - started)
    return best


def one_gradient(vpls: int) -> None:
    """One value and gradient with so many VPLs: what a process of its own is measured by."""
    receivers, lights = corner(np.random.default_rng(0), MEMORY_RECEIVERS, vpls)
    parameters = FalloffParameters(*map(jnp.float32, (1.0, 0.5, 0.1)))
    jax.block_until_ready(_gradient(receivers, lights, parameters))


def _energy(receivers, vpls, parameters):
    return jnp.sum(gather(receivers, vpls, parameters) ** 2)


_gradient = wide_jit(jax.value_and_grad(_energy, argnums=2))


def _bound(function: Callable, *arguments: object) -> Callable[[], object]:
    return lambda: function(*arguments)


def _peak_mebibytes(vpls: int) -> float:
    finished = subprocess.run(
        [sys.executable, "-c", _PEAK, str(vpls)], cwd=REPOSITORY, capture_output=True, check=True, text=True
    )
    return int(finished.stdout) / 1024.0


def peak_kibibytes() -> int:
    """Of this process so far. Linux's own: `getrusage` begins at what the starting process had."""
    status = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM:"))
