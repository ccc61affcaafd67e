"""The documentation: its flags exist, and its site builds without a warning and stands alone."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
import typer

from vpltune.cli.program import app

REPOSITORY = Path(__file__).resolve().parents[2]
PAGES = sorted((REPOSITORY / "docs").rglob("*.md"))
FLAG = re.compile(r"(?<![\w-])--[a-z][a-z-]+")


def test_every_flag_exists():
    """A flag in a page is one of some command's; other programs' flags are named here."""
    commands = typer.main.get_command(app).commands
    known = {name for command in commands.values() for option in command.params for name in option.opts}
    asked = {flag for page in PAGES for flag in FLAG.findall(page.read_text(encoding="utf-8"))}
    assert "--budget-ms" in asked
    assert not asked - known


def test_every_command_has_a_page():
    """Every `vpltune NAME` in a page is a command, and every command but `bench` and `doctor` has a page."""
    commands = set(typer.main.get_command(app).commands)
    texts = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    named = set(re.findall(r"vpltune ([a-z][a-z-]+) ", texts))
    assert named <= commands, named - commands
    jobs = "\n".join(page.read_text(encoding="utf-8") for page in (REPOSITORY / "docs" / "jobs").glob("*.md"))
    assert not [name for name in commands - {"bench", "doctor"} if f"vpltune {name} " not in jobs]


@pytest.mark.slow
def test_the_site_builds_and_stands_alone(tmp_path):
    pytest.importorskip("mkdocs")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    pages = sorted(tmp_path.rglob("*.html"))
    assert {"index.html", "runtime_formulas.html", "api.html"} <= {page.name for page in pages}
    for page in pages:
        loaded = re.findall(
            r"<(?:script|img|iframe)[^>]+src=[\"']?(https?:[^\"' >]+)"
            r"|<link[^>]+rel=[\"']?(?:stylesheet|preconnect|icon)[^>]+href=[\"']?(https?:[^\"' >]+)",
            page.read_text(encoding="utf-8"),
        )
        assert not loaded, f"{page.name} loads {loaded}"
