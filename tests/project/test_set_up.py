"""The set-up files: every package pinned by hash, no registry named, one command for tests."""

import os
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
REQUIREMENTS = (REPOSITORY / "requirements.txt").read_text(encoding="utf-8")


def normalised(name):
    """A project name as PEP 503 compares it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def test_every_line_of_the_requirements_is_a_pin_or_a_hash():
    lines = [line.strip().removesuffix("\\").strip() for line in REQUIREMENTS.splitlines()]
    for line in filter(None, lines):
        assert re.fullmatch(r"--hash=sha256:[0-9a-f]{64}|[a-z0-9-]+==[0-9A-Za-z.+]+( ; .*)?", line), line


def test_every_pin_has_a_hash():
    for block in re.split(r"\n(?=[a-z])", REQUIREMENTS.strip()):
        assert "--hash=sha256:" in block, block


def test_what_the_project_asks_for_is_pinned():
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    asked = [
        *project["build-system"]["requires"],
        *project["project"]["dependencies"],
        *(text for extra in project["project"]["optional-dependencies"].values() for text in extra),
    ]
    pinned = {line.partition("==")[0] for line in REQUIREMENTS.splitlines() if "==" in line}
    names = {normalised(re.split(r"[\s<>=!~;\[]", text)[0]) for text in asked}
    # One extra takes in others by the project's own name.
    assert names - {project["project"]["name"]} <= pinned


def test_no_set_up_file_names_a_registry():
    files = [
        "Makefile",
        "pyproject.toml",
        "requirements.txt",
        ".ci/run",
        "scripts/install_system_libraries.sh",
    ]
    for name in files:
        text = (REPOSITORY / name).read_text(encoding="utf-8")
        assert not re.search(r"https?://|file://", text), name


def test_continuous_integration_runs_make_test_and_nothing_else():
    commands = [
        line
        for line in (REPOSITORY / ".ci" / "run").read_text(encoding="utf-8").splitlines()
        if line and not line.startswith("#")
    ]
    assert commands == ["set -euo pipefail", 'cd "$(dirname "$0")/.."', "exec make test"]


def program(folder, name, script):
    """A program that stands before the system's own of that name."""
    path = folder / name
    path.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    path.chmod(0o755)


@pytest.mark.parametrize("user", ["0", "1000"])
@pytest.mark.parametrize("asked", [[], ["chromium"]])
def test_the_browser_is_installed_only_where_it_is_asked_for(tmp_path, user, asked):
    """On a system that has all but the browser: root installs it, others are told how."""
    program(tmp_path, "dpkg-query", 'for last; do :; done; [ "$last" = chromium ] || echo installed')
    program(tmp_path, "ldconfig", "echo libLLVM-19.so.1")
    program(tmp_path, "apt-get", f'echo "$@" >> {tmp_path}/apt.log')
    program(tmp_path, "id", f"echo {user}")
    program(tmp_path, "uname", "echo x86_64")
    done = subprocess.run(
        ["sh", str(REPOSITORY / "scripts" / "install_system_libraries.sh"), *asked],
        env={**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        check=True,
    )
    log = tmp_path / "apt.log"
    installed = log.read_text(encoding="utf-8") if log.exists() else ""
    assert installed == ("install -y -q --no-install-recommends chromium\n" if asked and user == "0" else "")
    assert ("sudo apt-get install chromium" in done.stderr) == (bool(asked) and user != "0")


@pytest.mark.parametrize(("target", "wanted"), [("test", True), ("test-all", True), ("demo", False)])
def test_only_tests_want_the_browser(target, wanted):
    command = ["make", "--dry-run", "--always-make", target]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=True)
    assert ("install_system_libraries.sh chromium" in done.stdout) == wanted
