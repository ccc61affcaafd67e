"""What every command has: `--quiet`, `--verbose`, a line for a missing extra; and `--version`, completion."""

import importlib.metadata
import json
import logging
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import vpltune.cli.program as program
import vpltune.renderer.config.tuned_config
from vpltune.cli.batch_display import SilentDisplay, shown_batch
from vpltune.cli.program import COMMANDS, run
from vpltune.cli.progress_display import shown_progress
from vpltune.cli.report import warn
from vpltune.cli.verbosity import choose_verbosity, reset_verbosity
from vpltune.renderer.errors import InputError
from vpltune.tuner.doctor.extras import EXTRA_MODULES, extra_to_install, is_installed, missing_modules

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def normal_verbosity():
    yield
    reset_verbosity()


def export_to(folder, *more):
    return ["export", "default", "--to", "json", "-o", str(folder / "out.json"), *more]


@pytest.fixture
def noted_export(monkeypatch):
    """Reading a config leaves a note and a line in the log."""
    read = vpltune.renderer.config.tuned_config.read_config

    def read_noted(source, **options):
        warn(("a note",))
        logging.getLogger("vpltune.renderer").warning("a warning")
        logging.getLogger("vpltune.renderer").debug("a detail")
        return read(source, **options)

    monkeypatch.setattr(vpltune.renderer.config.tuned_config, "read_config", read_noted)


def test_the_version_is_that_of_the_package(capfd):
    assert run(["--version"]) == 0
    assert capfd.readouterr().out == f"vpltune {importlib.metadata.version('vpltune')}\n"


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_takes_the_flags(capfd, name):
    assert run([name, "--help"]) == 0
    shown = capfd.readouterr().out
    assert "--quiet" in shown
    assert "--verbose" in shown


@pytest.mark.usefixtures("noted_export")
@pytest.mark.parametrize("before", [True, False])
def test_quiet_leaves_out_notes_and_progress(capfd, tmp_path, before):
    arguments = export_to(tmp_path)
    assert run(["-q", *arguments] if before else [*arguments, "--quiet"]) == 0
    shown = capfd.readouterr()
    assert shown.err == ""
    assert shown.out.startswith("wrote ")
    assert run(arguments) == 0
    assert "vpltune: a note\n" in capfd.readouterr().err


def test_quiet_says_errors(capfd):
    assert run(["export", "absent.json", "--to", "json", "-o", "out.json", "-q"]) == 2
    assert capfd.readouterr().err.startswith("vpltune: absent.json: ")


def test_quiet_has_no_progress(capfd):
    choose_verbosity(True, False)
    with shown_progress() as progress:
        progress("reference", 0.5)
    with shown_batch(1) as watcher:
        assert isinstance(watcher, SilentDisplay)
        watcher.found([], 0)
        watcher.happened({"event": "record"})
    assert capfd.readouterr().err == ""


@pytest.mark.usefixtures("noted_export")
@pytest.mark.parametrize("more", [[], ["--json"]])
def test_verbose_says_log_versions_and_time(capfd, tmp_path, more):
    assert run(export_to(tmp_path, "-v", *more)) == 0
    shown = capfd.readouterr()
    lines = shown.err.splitlines()
    assert lines[:3] == ["vpltune: a note", "vpltune: a warning", "vpltune: a detail"]
    assert re.fullmatch(r"vpltune: vpltune \S+, numpy \S+, .*Python 3\.\d+\.\d+ on \w+", lines[3])
    assert re.fullmatch(r"vpltune: \d+\.\d\d s in all", lines[4])
    if more:
        assert json.loads(shown.out)["status"] == "ok"


def test_verbose_shows_where_bad_input_was_found(capfd):
    assert run(["-v", "export", "absent.json", "--to", "json", "-o", "out.json"]) == 2
    shown = capfd.readouterr().err
    assert "Traceback" in shown
    assert "InputError" in shown


def test_verbose_says_how_long_each_stage_took(capfd):
    choose_verbosity(False, True)
    with shown_progress() as progress:
        progress("reference", 0.0)
        progress("fit", 0.0)
    lines = capfd.readouterr().err.splitlines()
    assert lines[:2] == ["vpltune: reference", "vpltune: fit"]
    assert [re.sub(r"\d+\.\d\d", "N", line) for line in lines[2:]] == [
        "vpltune: reference took N s",
        "vpltune: fit took N s",
    ]


@pytest.mark.parametrize(
    "arguments", [["-q", "-v", "doctor"], ["-q", "doctor", "-v"], ["doctor", "-v", "-q"]]
)
def test_quiet_and_verbose_exclude_each_other(capfd, arguments):
    assert run(arguments) == 2
    assert "--quiet and --verbose: only one of them can be given" in capfd.readouterr().err
    with pytest.raises(InputError):
        choose_verbosity(True, True)


@pytest.mark.parametrize("module", ["jax", "jaxlib.xla_client", "mitsuba", "submitit", "tensorboardX"])
@pytest.mark.parametrize("more", [[], ["--json"]])
def test_a_missing_extra_is_one_line_and_exit_code_3(capfd, monkeypatch, tmp_path, module, more):
    def fail(source, **options):
        raise ModuleNotFoundError(f"No module named {module!r}", name=module)

    root = module.partition(".")[0]
    monkeypatch.setitem(sys.modules, root, None)
    monkeypatch.setattr(vpltune.renderer.config.tuned_config, "read_config", fail)
    assert run(export_to(tmp_path, *more)) == 3
    extra = next(extra for extra, modules in EXTRA_MODULES.items() if root in modules)
    line = f'vpltune export needs vpltune[{extra}], which is not installed: pip install "vpltune[{extra}]"'
    shown = capfd.readouterr()
    assert shown.err == f"vpltune: {line}\n"
    if more:
        assert json.loads(shown.out) == {"status": "failed", "error": line}


@pytest.mark.parametrize(
    "error",
    [
        ModuleNotFoundError("No module named 'vpltune.lost'", name="vpltune.lost"),
        # Installed here: what failed is not its absence.
        ModuleNotFoundError("No module named 'jax.lost'", name="jax.lost"),
        ImportError("libLLVM.so: cannot open shared object file", name="mitsuba"),
    ],
)
def test_any_other_failed_import_is_a_defect(capfd, monkeypatch, tmp_path, error):
    def fail(source, **options):
        raise error

    monkeypatch.setattr(vpltune.renderer.config.tuned_config, "read_config", fail)
    assert run(export_to(tmp_path)) == 1
    assert "Traceback" in capfd.readouterr().err


def test_an_extra_is_found_behind_an_error_in_other_words(monkeypatch):
    monkeypatch.setitem(sys.modules, "jaxlib", None)
    try:
        try:
            import jaxlib  # noqa: F401
        except ImportError as cause:
            raise ModuleNotFoundError("jax requires jaxlib to be installed") from cause
    except ModuleNotFoundError as error:
        assert extra_to_install(error) == "tuner"
    assert missing_modules("tuner") == ("jaxlib",)
    assert not is_installed("jaxlib")


def test_the_extras_are_those_of_pyproject():
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = {name: needs for name, needs in project["optional-dependencies"].items() if name != "dev"}
    listed = {
        extra: {re.split(r"[<>=]", need)[0].replace("-", "_") for need in needs}
        for extra, needs in extras.items()
    }
    # jax brings jaxlib, and looks for it itself.
    assert {extra: set(modules) - {"jaxlib"} for extra, modules in EXTRA_MODULES.items()} == listed


def test_benchmarks_are_offered_in_a_checkout_only(tmp_path):
    """An installed package has no benchmarks beside it: the command says so, and `--help` leaves it out."""
    for name in ("cli", "renderer", "tuner"):
        (tmp_path / "vpltune").mkdir(exist_ok=True)
        (tmp_path / "vpltune" / name).symlink_to((REPOSITORY / "vpltune" / name).resolve())
    for name in ("__init__.py", "__main__.py", "guard.py"):
        (tmp_path / "vpltune" / name).write_bytes((REPOSITORY / "vpltune" / name).read_bytes())

    def shown(*arguments):
        command = [sys.executable, "-m", "vpltune", *arguments]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)

    assert not re.search(r"^\W*bench ", shown("--help").stdout, re.MULTILINE)
    assert program.CHECKOUT == REPOSITORY
    there = subprocess.run(
        [sys.executable, "-m", "vpltune", "--help"], cwd=REPOSITORY, capture_output=True, text=True
    )
    assert re.search(r"^\W*bench ", there.stdout, re.MULTILINE)


@pytest.mark.parametrize(
    ("words", "place", "wanted"),
    [("vpltune re", "1", {"render", "report"}), ("vpltune fit --vpl", "2", {"--vpl-count"})],
)
def test_a_shell_is_told_what_may_follow(words, place, wanted):
    done = subprocess.run(
        [sys.executable, "-m", "vpltune"],
        cwd=REPOSITORY,
        env={**os.environ, "_VPLTUNE_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": place},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert set(done.stdout.split()) == wanted
