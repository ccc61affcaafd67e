"""The set-up files: every package pinned by hash, no registry named, one command for tests."""

import re
import tomllib
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
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
        *project["project"]["optional-dependencies"]["dev"],
    ]
    pinned = {line.partition("==")[0] for line in REQUIREMENTS.splitlines() if "==" in line}
    assert {normalised(re.split(r"[\s<>=!~;\[]", text)[0]) for text in asked} <= pinned


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
