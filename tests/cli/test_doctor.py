"""`vpltune doctor`: every probe answers here, and one that dies is a finding."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import vpltune.tuner.doctor.machine_findings
import vpltune.tuner.doctor.machine_probes
from vpltune.cli.program import run
from vpltune.tuner.doctor.machine_findings import PROBES, Finding, Probe, run_probe
from vpltune.tuner.doctor.machine_probes import PROBE_FUNCTIONS

REPOSITORY = Path(__file__).resolve().parents[2]
PROBE = Probe("thing", "mend the thing", True)


UNBOUNDED = 1e6
"""Seconds for a probe: eleven days, since another load may make it late."""


@pytest.fixture
def probe_script(tmp_path, monkeypatch):
    """Puts a module `faulty_probe` where a probe's process finds it."""
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))

    def write(source):
        (tmp_path / "faulty_probe.py").write_text(source)
        return lambda seconds=UNBOUNDED: run_probe(PROBE, seconds, "faulty_probe")

    return write


def test_every_probe_has_a_function():
    assert [probe.name for probe in PROBES] == list(PROBE_FUNCTIONS)


@pytest.mark.parametrize("name", ["python", "egl", "opengl", "llvm", "cache"])
def test_what_the_tests_themselves_need_is_found(name, tmp_path, monkeypatch):
    monkeypatch.setenv("VPLTUNE_CACHE", str(tmp_path))
    finding = run_probe(next(probe for probe in PROBES if probe.name == name), UNBOUNDED)
    assert finding.state in ("ok", "fallback"), finding
    assert bool(finding.fallback) == (finding.state == "fallback")
    assert "\n" not in finding.detail


def test_a_cache_folder_that_cannot_be_is_a_fallback(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("VPLTUNE_CACHE", str(tmp_path / "file" / "cache"))
    finding = run_probe(next(probe for probe in PROBES if probe.name == "cache"), UNBOUNDED)
    assert (finding.state, finding.required) == ("fallback", False)
    assert "cannot be written" in finding.detail


def test_a_probe_that_says_something_is_taken_at_its_word(probe_script):
    probe = probe_script('print(\'noise\'); print(\'{"state": "ok", "detail": "fine"}\')')
    assert probe() == Finding("thing", "ok", "fine")


def test_a_crash_is_a_finding(probe_script):
    finding = probe_script("import os; os.abort()")()
    assert (finding.state, finding.mend) == ("missing", "mend the thing")
    assert finding.detail == "the probe was killed by SIGABRT"


def test_an_exception_is_a_finding(probe_script):
    assert probe_script("import no_such_library")().detail == (
        "ModuleNotFoundError: No module named 'no_such_library'"
    )


def test_a_hang_is_a_finding(probe_script):
    assert probe_script("import time; time.sleep(60)")(0.5).detail == "no answer within 0.5 s"


def test_silence_is_a_finding(probe_script):
    assert probe_script("")().detail == "exit code 0 and no output"


def test_an_answer_of_another_shape_is_a_finding(probe_script):
    assert probe_script('print(\'{"mood": "good"}\')')().state == "missing"


@pytest.mark.parametrize(
    ("states", "code", "status"),
    [
        ({"a": ("ok", True), "b": ("fallback", True), "c": ("missing", False)}, 0, "ok"),
        ({"a": ("missing", True), "b": ("missing", True)}, 3, "missing: a, b"),
    ],
)
def test_what_is_required_decides_the_exit_code(capfd, monkeypatch, states, code, status):
    findings = tuple(
        Finding(name, state, "found [this]", fallback="that", mend=f"mend {name}", required=required)
        for name, (state, required) in states.items()
    )
    monkeypatch.setattr(vpltune.tuner.doctor.machine_findings, "examine_machine", lambda: findings)
    assert run(["doctor", "--json"]) == code
    document = json.loads(capfd.readouterr().out)
    assert document["status"] == status
    assert document["findings"] == [finding.as_dict() for finding in findings]
    assert run(["doctor"]) == code
    shown = capfd.readouterr().out
    assert all(f"to mend: mend {name}" in shown for name in states)
    assert "found [this]" in " ".join(shown.split())


@pytest.mark.slow  # loads JAX and tries Mitsuba, each in a process of its own
def test_the_whole_machine_is_examined(capfd):
    assert run(["doctor", "--json"]) == 0
    document = json.loads(capfd.readouterr().out)
    assert [finding["name"] for finding in document["findings"]] == [probe.name for probe in PROBES]
    assert sys.executable in document["findings"][0]["detail"]


def test_without_the_tuner_its_probes_are_not_tried(capfd, monkeypatch):
    """An installation of the runtime alone is whole: it is told what is not there, and is not at fault."""
    monkeypatch.setattr(
        vpltune.tuner.doctor.machine_findings, "missing_modules", lambda extra: ("jax", "mitsuba")
    )
    found = {probe.name: run_probe(probe) for probe in PROBES if probe.extra}
    assert set(found) == {"jax", "llvm", "mitsuba"}
    for finding in found.values():
        assert (finding.state, finding.required) == ("missing", False)
        assert finding.detail == "needs vpltune[tuner], which is not installed"
        assert finding.mend == 'pip install "vpltune[tuner]"'


def test_the_extras_that_are_not_installed_are_named(monkeypatch):
    monkeypatch.setattr(
        vpltune.tuner.doctor.machine_probes,
        "missing_modules",
        lambda extra: ("submitit",) if extra == "cluster" else (),
    )
    said = vpltune.tuner.doctor.machine_probes.probe_extras()
    assert said == {
        "state": "ok",
        "detail": "installed: tuner, ktx, tensorboard; not installed: cluster (no submitit)",
    }


def test_without_the_tuner_the_verdict_says_what_can_be_done(capfd, monkeypatch):
    findings = (Finding("extras", "missing", "not installed: tuner", mend="install it", required=False),)
    monkeypatch.setattr(vpltune.tuner.doctor.machine_findings, "examine_machine", lambda: findings)
    assert run(["doctor"]) == 0
    assert "This machine can render, export and import; fits need vpltune[tuner]." in capfd.readouterr().out


def test_a_platform_that_jax_lacks_is_named():
    """`JAX_PLATFORMS=cuda` without CUDA was a defect of ours to `fit`, and a missing JAX to `doctor`."""
    program = (
        "from vpltune.renderer.errors import MachineError\n"
        "from vpltune.tuner.doctor.jax_platform import require_jax_platform\n"
        "try: require_jax_platform()\n"
        "except MachineError as error: print(error)"
    )
    for platform in ("cuda", "abacus"):
        environment = {**os.environ, "JAX_PLATFORMS": platform, "PYTHONPATH": str(REPOSITORY)}
        done = subprocess.run(
            [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
        )
        assert re.fullmatch(rf"JAX_PLATFORMS={platform}: JAX cannot start \(.+\); unset it\n", done.stdout)
