"""The surrogate's throughput against this machine's matrix product, and its peak memory with many VPLs."""

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
from benchmarks.speed.lit_corner import lit_corner
from vpltune.tuner.surrogate.vpl_gather import FalloffParameters, gather
from vpltune.tuner.surrogate.wide_vectors import wide_jit

FLOPS_PER_PAIR = 40.0
"""Floating-point operations for a pair of receiver and VPL, counted in the gather's code; a root, an
exponential and a quotient each count as a few."""
MATRIX = 2048
"""Rows of the square matrices whose product is timed. A choice."""
RECEIVERS = 16_384
"""Receivers of the timed gather: four times those that a fit takes from one view."""
VPLS = 1_024
"""VPLs of the timed gather: twice the default count."""
FORWARD_AIM = 0.25
"""Share of the matrix product's rate that the gather should reach. A choice."""
REPEATS = 9
"""Timed runs, of which the fastest counts. A choice."""
FEW_VPLS, MANY_VPLS = 256, 16_384
"""VPL counts whose peak memory is compared. A choice: memory that grows with the
number of pairs would grow 64-fold."""
MEMORY_RECEIVERS = 4_096
"""Receivers of the memory measurement: those that a fit takes from one view."""
_PEAK = """
import sys
from benchmarks.speed.surrogate import one_gradient, peak_kibibytes
one_gradient(int(sys.argv[1]))
print(peak_kibibytes())
"""


def rows(progress: Callable[[str, float], None]) -> list[Row]:
    """Rates of the gather and its gradient over the matrix product's, and peak memory with many and few VPLs.

    `forward_share_of_matmul` and `gradient_share_of_matmul` count 40 operations for each pair of receiver and
    VPL, and divide by the rate of a float32 matrix product. `peak_memory_16384_vpls` compares two processes
    that each compute one gradient.
    """
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
    """The fastest run of each function; they run in turns, so that other load slows all of them alike."""
    receivers, vpls = lit_corner(np.random.default_rng(0), RECEIVERS, VPLS)
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
            # The first run compiles.
            if repeat:
                best[name] = min(best[name], time.perf_counter() - started)
    return best


def one_gradient(vpls: int) -> None:
    """Compute one gradient with `vpls` VPLs, in a process of its own whose memory is measured."""
    receivers, lights = lit_corner(np.random.default_rng(0), MEMORY_RECEIVERS, vpls)
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
    """Peak memory of this process, from /proc: `getrusage` would start at the parent process's peak."""
    status = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM:"))
