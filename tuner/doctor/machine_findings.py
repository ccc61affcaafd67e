"""What of this machine works: one finding per thing that the program stands on.

Each probe runs in a process of its own, with a time limit, because a bad driver or an LLVM too old
for the processor ends the whole process: that, too, is a finding.
"""

import json
import os
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from vpltune.tuner.doctor.extras import how_to_install, missing_modules

State = Literal["ok", "fallback", "missing"]

PROBE_SECONDS = 150.0
"""Longer than Mitsuba's own search for an LLVM library that works, which has limits of its own."""


@dataclass(frozen=True)
class Finding:
    """One thing the program stands on, as found on this machine."""

    name: str
    state: State
    detail: str
    """What was found, in one line."""
    fallback: str = ""
    """What is used instead, where the state is "fallback"."""
    mend: str = ""
    """The one command that mends it, where the state is not "ok"."""
    required: bool = True
    """Whether the program is of no use without it."""

    def as_dict(self) -> dict[str, str | bool]:
        """The finding as `vpltune doctor --json` prints it."""
        return asdict(self)


@dataclass(frozen=True)
class Probe:
    """How a finding is made: a function of `tuner.doctor.machine_probes`, and what its death means."""

    name: str
    mend: str
    required: bool
    extra: str = ""
    """The extra that it belongs to; without that there is nothing to try, and nothing is required."""


APT_OPENGL = "apt-get install -y libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri"
APT_LLVM = "apt-get install -y libllvm19"
_REQUIREMENTS = Path(__file__).resolve().parents[2] / "requirements.txt"
# An installed package has no requirements.txt beside it.
PIP = (
    f"{sys.executable} -m pip install --require-hashes -r {_REQUIREMENTS}"
    if _REQUIREMENTS.is_file()
    else f"{sys.executable} -m {how_to_install('tuner')}"
)

PROBES = (
    Probe("python", "apt-get install -y python3.11 python3.11-venv", True),
    Probe("egl", APT_OPENGL, True),
    Probe("opengl", APT_OPENGL, True),
    Probe("extras", PIP, False),
    Probe("jax", PIP, True, "tuner"),
    Probe("llvm", APT_LLVM, False, "tuner"),
    Probe("mitsuba", PIP, True, "tuner"),
    Probe("cache", "export VPLTUNE_CACHE=/a/folder/that/can/be/written", False),
)


def examine_machine(seconds: float = PROBE_SECONDS) -> tuple[Finding, ...]:
    """All findings, in the order of `PROBES`; each probe gets at most `seconds`."""
    with ThreadPoolExecutor(max_workers=max(1, os.cpu_count() or 1)) as pool:
        return tuple(pool.map(lambda probe: run_probe(probe, seconds), PROBES))


def run_probe(
    probe: Probe, seconds: float = PROBE_SECONDS, module: str = "vpltune.tuner.doctor.machine_probes"
) -> Finding:
    """The finding of one probe: what its process says, or how that process died."""
    if probe.extra and missing_modules(probe.extra):
        detail = f"needs vpltune[{probe.extra}], which is not installed"
        return Finding(probe.name, "missing", detail, mend=how_to_install(probe.extra), required=False)
    command = [sys.executable, "-m", module, probe.name]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        return _died(probe, f"no answer within {seconds:g} s")
    except OSError as error:
        return _died(probe, f"cannot be tried ({error.strerror})")
    if done.returncode < 0:
        return _died(probe, f"trying it ended the process with {signal.Signals(-done.returncode).name}")
    try:
        # A library may have printed before.
        said = json.loads(done.stdout.strip().rpartition("\n")[2])
        return Finding(name=probe.name, required=probe.required, **said)
    except (ValueError, TypeError):
        last = done.stderr.strip().rpartition("\n")[2] or f"exit code {done.returncode} without a word"
        return _died(probe, last)


def _died(probe: Probe, detail: str) -> Finding:
    return Finding(probe.name, "missing", detail, mend=probe.mend, required=probe.required)
