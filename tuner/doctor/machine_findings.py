"""Check this machine: one finding for each dependency of the program.

Each probe runs in a separate process with a time limit, because a bad driver, or an LLVM library too old for
the processor, kills the whole process. A crash is a finding too.
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
"""Time limit of a probe. A choice: enough for two timeouts in the search for an LLVM library
(`tuner.reference.variant`)."""


@dataclass(frozen=True)
class Finding:
    """The state of one dependency on this machine."""

    name: str
    state: State
    detail: str
    """What was found; one line."""
    fallback: str = ""
    """What is used instead, if the state is "fallback"."""
    mend: str = ""
    """The command that fixes it, if the state is not "ok"."""
    required: bool = True
    """Whether the program does not work without it."""

    def as_dict(self) -> dict[str, str | bool]:
        """The finding as `vpltune doctor --json` prints it."""
        return asdict(self)


@dataclass(frozen=True)
class Probe:
    """One check: a function of `tuner.doctor.machine_probes`, and what to report if its process crashes."""

    name: str
    """Key of `PROBE_FUNCTIONS`."""
    mend: str
    """The command that fixes it."""
    required: bool
    """Whether the program does not work without it."""
    extra: str = ""
    """The extra that it checks. Without that extra it is not run and nothing is required."""


# Commands that fix a finding.
APT_OPENGL = "apt-get install -y libegl1 libegl-mesa0 libgl1 libgl1-mesa-dri"
APT_LLVM = "apt-get install -y libllvm19"
_REQUIREMENTS = Path(__file__).resolve().parents[2] / "requirements.txt"
# An installed package has no requirements.txt beside it.
PIP = (
    f"{sys.executable} -m pip install --require-hashes -r {_REQUIREMENTS}"
    if _REQUIREMENTS.is_file()
    else f"{sys.executable} -m {how_to_install('tuner')}"
)

# All checks, in the order of the table.
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
    """Run all probes in parallel, each for at most `seconds`. The findings are in the order of `PROBES`."""
    with ThreadPoolExecutor(max_workers=max(1, os.cpu_count() or 1)) as pool:
        return tuple(pool.map(lambda probe: run_probe(probe, seconds), PROBES))


def run_probe(
    probe: Probe, seconds: float = PROBE_SECONDS, module: str = "vpltune.tuner.doctor.machine_probes"
) -> Finding:
    """Run one probe in a separate process, for at most `seconds`. A crash or a timeout is a finding too."""
    if probe.extra and missing_modules(probe.extra):
        detail = f"needs vpltune[{probe.extra}], which is not installed"
        return Finding(probe.name, "missing", detail, mend=how_to_install(probe.extra), required=False)
    command = [sys.executable, "-m", module, probe.name]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        return _died(probe, f"no answer within {seconds:g} s")
    except OSError as error:
        return _died(probe, f"the probe cannot be run ({error.strerror})")
    if done.returncode < 0:
        return _died(probe, f"the probe was killed by {signal.Signals(-done.returncode).name}")
    try:
        # The finding is the last line: a library may have printed something before it.
        said = json.loads(done.stdout.strip().rpartition("\n")[2])
        return Finding(name=probe.name, required=probe.required, **said)
    except (ValueError, TypeError):
        last = done.stderr.strip().rpartition("\n")[2] or f"exit code {done.returncode} and no output"
        return _died(probe, last)


def _died(probe: Probe, detail: str) -> Finding:
    return Finding(probe.name, "missing", detail, mend=probe.mend, required=probe.required)
