"""What a machine's GPU can do at most: arithmetic rate, by a small shader, and memory rate, by a copy.

A pass that does `operations` and moves `bytes` takes at least the longer of operations/rate and bytes/rate
(Williams et al. 2009, "Roofline").
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import moderngl

from vpltune.renderer.frame.frame_timing import Clock, truthful_clock

SHADER = Path(__file__).with_name("arithmetic_rate.comp")
GROUP = 64
"""Invocations of a workgroup; also in the shader."""
GROUPS = 4096
"""Workgroups of the arithmetic: some thousand invocations for each multiprocessor of the largest GPUs."""
ROUND_OPERATIONS = 8 * 4 * 2
"""Operations of a round: eight statements of four lanes, a product and a sum each."""
FEWEST_ROUNDS = 16
"""Where doubling begins. A choice."""
MOST_ROUNDS = 32_768
"""llvmpipe ends loops after 65,535 rounds."""
COPIED_BYTES = 2**28
"""Bytes of each buffer: several times the largest caches."""
LONG_ENOUGH_S = 0.05
"""Seconds of a run whose rate is believed. A choice: a thousand times what a launch takes."""
REPEATS = 3
"""Runs of which the fastest counts. A choice."""


@dataclass(frozen=True)
class MachineRates:
    """Rates that no pass exceeds."""

    operations_per_second: float
    """32-bit floating point; a fused multiply-add counts as two."""
    bytes_per_second: float
    """Read and written."""
    clock: Clock
    """Which clock tells the truth here: "gpu" or "wall"."""

    def milliseconds(self, operations: float, moved_bytes: float) -> float:
        """The least time in which so much can be done."""
        return 1e3 * max(operations / self.operations_per_second, moved_bytes / self.bytes_per_second)


def measured_rates(context: moderngl.Context) -> MachineRates:
    """Measure the machine that `context` draws on, within a few seconds."""
    clock = measured_clock(context)
    return MachineRates(_operations_per_second(context, clock), _bytes_per_second(context, clock), clock)


def measured_clock(context: moderngl.Context) -> Clock:
    """ "gpu" where a timer query agrees with the wall clock about work of known length, else "wall".

    Software renderers run work after the query has ended. Known ones are told by their name.
    """
    if truthful_clock(str(context.info["GL_RENDERER"])) == "wall":
        return "wall"
    shader, sums = _arithmetic(context)
    rounds = _rounds_for(shader, context)
    wall = _seconds(context, lambda: _run_rounds(shader, rounds), "wall")
    gpu = _seconds(context, lambda: _run_rounds(shader, rounds), "gpu")
    sums.release()
    # Launching and waiting are part of the wall clock's time alone.
    return "gpu" if gpu > 0.5 * wall else "wall"


def _operations_per_second(context: moderngl.Context, clock: Clock) -> float:
    shader, sums = _arithmetic(context)
    rounds = _rounds_for(shader, context)
    seconds = min(_seconds(context, lambda: _run_rounds(shader, rounds), clock) for _ in range(REPEATS))
    sums.release()
    return GROUPS * GROUP * rounds * ROUND_OPERATIONS / seconds


def _bytes_per_second(context: moderngl.Context, clock: Clock) -> float:
    source, target = (context.buffer(reserve=COPIED_BYTES) for _ in range(2))
    source.clear()
    # The first run touches memory that the system has not given yet.
    seconds = [
        _seconds(context, lambda: context.copy_buffer(target, source), clock) for _ in range(1 + REPEATS)
    ]
    source.release()
    target.release()
    return 2.0 * COPIED_BYTES / min(seconds[1:])


def _arithmetic(context: moderngl.Context) -> tuple[moderngl.ComputeShader, moderngl.Buffer]:
    shader = context.compute_shader(SHADER.read_text(encoding="utf-8"))
    # Below 1, so that the chains stay finite.
    shader["factor"] = 0.5
    sums = context.buffer(reserve=4 * GROUPS * GROUP)
    sums.bind_to_storage_buffer(0)
    return shader, sums


def _rounds_for(shader: moderngl.ComputeShader, context: moderngl.Context) -> int:
    """Rounds that take `LONG_ENOUGH_S`, by doubling."""
    rounds = FEWEST_ROUNDS
    _run_rounds(shader, rounds)
    context.finish()
    while rounds < MOST_ROUNDS:
        start = time.perf_counter()
        _run_rounds(shader, rounds)
        context.finish()
        if time.perf_counter() - start >= LONG_ENOUGH_S:
            break
        rounds *= 2
    return rounds


def _run_rounds(shader: moderngl.ComputeShader, rounds: int) -> None:
    shader["rounds"] = rounds
    shader.run(GROUPS)


def _seconds(context: moderngl.Context, work: Callable[[], object], clock: Clock) -> float:
    context.finish()
    if clock == "gpu":
        with context.query(time=True) as query:
            work()
        return query.elapsed * 1e-9
    start = time.perf_counter()
    work()
    context.finish()
    return time.perf_counter() - start
