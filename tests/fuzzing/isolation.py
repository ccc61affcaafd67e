"""Runs cases in forks of a warm process, under limits of memory and processor time.

A fork takes one case after the other and reports each through a pipe. Where the fork dies, the case that it
was at is the finding, and another fork goes on after it. The process must have neither OpenGL nor threads.
"""

import faulthandler
import json
import os
import re
import resource
import select
import shutil
import signal
import tempfile
import time
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.fuzzing.cases import READERS, Case
from tests.fuzzing.outcomes import Outcome, judged, place_of
from tests.support.reading_cost import CPU_S, CPU_S_PER_BYTE, MEMORY_BYTES


@dataclass(frozen=True)
class Limits:
    """What reading one file may take."""

    cpu_s: float = CPU_S
    """Processor time in s, whatever the file's size."""
    cpu_s_per_byte: float = CPU_S_PER_BYTE
    """Further processor time in s for each byte of the case's files."""
    memory_bytes: int = MEMORY_BYTES
    """Address space above that of the warm process."""
    wall_s: float = 60.0
    """A choice: after this time without a report, a fork stands still rather than computes."""


BATCH = 250
"""A choice: cases for each fork; a fork takes as long as about ten cases."""
_OWN_ERROR = 70
"""Exit code of a fork for an error of the fuzzer's own: EX_SOFTWARE of sysexits.h."""
_TOO_SLOW = "more than"
_TRACE_LINE = re.compile(r'File "(.+?)", line (\d+)')


def outcomes(named: list[Case], limits: Limits) -> Iterator[tuple[Case, Outcome]]:
    """The outcome of each case, in order. Findings are tried again alone, in a fork of their own."""
    at = 0
    while at < len(named):
        for outcome in _of_one_fork(named[at : at + BATCH], limits):
            case = named[at]
            if outcome.verdict == "finding":
                outcome = _alone(case, outcome, limits)
            yield case, outcome
            at += 1


def _alone(case: Case, found: Outcome, limits: Limits) -> Outcome:
    again = next(iter(_of_one_fork([case], limits)))
    # Where others use the same core, processor time is measured too long: what is slow must be so twice.
    if again.verdict == "finding" or found.kind.startswith(_TOO_SLOW):
        return again
    return Outcome("finding", f"{found.kind}, but not alone", found.message)


def _of_one_fork(batch: list[Case], limits: Limits) -> Iterator[Outcome]:
    """Outcomes of the batch's cases, up to the one at which the fork died."""
    folder = Path(tempfile.mkdtemp(prefix="fuzzing-"))
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _work(batch, limits, folder, writing)
    os.close(writing)
    stopped = False
    try:
        with os.fdopen(reading, "rb", buffering=0) as pipe:
            done, rest = 0, b""
            while done < len(batch):
                if not select.select([pipe], [], [], limits.wall_s)[0]:
                    stopped = True
                    break
                read = pipe.read(1 << 16)
                if not read:
                    break
                *lines, rest = (rest + read).split(b"\n")
                for line in lines:
                    yield Outcome(*json.loads(line))
                    done += 1
        if stopped:
            os.kill(child, signal.SIGKILL)
        status = os.waitpid(child, 0)[1]
        child = 0
        if done < len(batch):
            yield _of_death(status, stopped, folder / "trace", limits)
    finally:
        if child:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
        shutil.rmtree(folder, ignore_errors=True)


def _of_death(status: int, stopped: bool, trace: Path, limits: Limits) -> Outcome:
    text = trace.read_text(encoding="utf-8", errors="replace") if trace.exists() else ""
    place = place_of([(file, int(line)) for file, line in _TRACE_LINE.findall(text)])
    if stopped:
        return Outcome("finding", f"no answer for {limits.wall_s:g} s")
    if status and os.WIFEXITED(status) and os.WEXITSTATUS(status) == _OWN_ERROR:
        raise RuntimeError(f"the fuzzer itself failed: {text}")
    if not os.WIFSIGNALED(status):
        return Outcome("finding", f"exit with code {os.WEXITSTATUS(status)} at {place}")
    number = os.WTERMSIG(status)
    if number == signal.SIGPROF:
        # Where it was just then differs from case to case: only the file tells one fault from another.
        kind = f"{_too_slow(limits)} in {place.partition(':')[0]}"
        return Outcome("finding", kind, place)
    return Outcome("finding", f"{signal.Signals(number).name} at {place}", text.strip().split("\n")[0][:200])


def _too_slow(limits: Limits) -> str:
    return f"{_TOO_SLOW} {limits.cpu_s:g} s and {1e6 * limits.cpu_s_per_byte:g} µs a byte of processor time"


def _work(batch: list[Case], limits: Limits, folder: Path, writing: int) -> None:
    """In the fork. Never returns."""
    case = None
    try:
        # Ctrl-C is for the process that started this one, which ends it.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        quiet = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(quiet, stream)
        with (folder / "trace").open("w") as trace:
            # Writes the stack of what is too slow or crashes, even in C; then the signal ends the process.
            faulthandler.enable(trace, all_threads=False)
            signal.signal(signal.SIGPROF, signal.SIG_DFL)
            faulthandler.register(signal.SIGPROF, trace, all_threads=False, chain=True)
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            most = _address_space() + limits.memory_bytes
            resource.setrlimit(resource.RLIMIT_AS, (most, most))
            for number, case in enumerate(batch):
                place = folder / str(number)
                place.mkdir()
                outcome = _of_case(case, place, limits)
                report = json.dumps([outcome.verdict, outcome.kind, outcome.message])
                os.write(writing, report.encode() + b"\n")
                shutil.rmtree(place, ignore_errors=True)
        os._exit(0)
    except BaseException:
        (folder / "trace").write_text(f"case {case}\n{traceback.format_exc()}", encoding="utf-8")
        os._exit(_OWN_ERROR)


def _of_case(case: Case, place: Path, limits: Limits) -> Outcome:
    path, mutated = case.write(place)
    allowed_s = limits.cpu_s + limits.cpu_s_per_byte * sum(file.stat().st_size for file in place.iterdir())
    signal.setitimer(signal.ITIMER_PROF, allowed_s)
    begin = time.process_time()
    outcome = judged(READERS[case.reader].read, path, mutated)
    spent = time.process_time() - begin
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    # The timer counts in ticks of the kernel.
    if spent > allowed_s and outcome.verdict != "finding":
        return Outcome("finding", _too_slow(limits), f"{spent:.1f} s")
    return outcome


def _address_space() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
