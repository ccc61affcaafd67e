"""The command line: exit codes, one line per failure, one JSON object on stdout."""

import errno
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import get_args

import pytest

import vpltune.renderer.config.tuned_config
import vpltune.renderer.export.config_export
from vpltune.cli.options import Layer
from vpltune.cli.program import run
from vpltune.renderer.config.tuned_config import TunedConfig, read_config, write_config
from vpltune.renderer.errors import MachineError
from vpltune.renderer.frame.runtime import LAYERS

COMMANDS = ("fit", "batch", "render", "evaluate", "export", "report", "doctor", "bench")
REPOSITORY = Path(__file__).resolve().parents[2]


def start(*arguments, **options):
    """The real program, in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-m", "vpltune", *arguments],
        cwd=REPOSITORY,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def export_to(folder, *more):
    return ["export", "default", "--to", "json", "-o", str(folder / "out.json"), *more]


def test_help_lists_every_command(capfd):
    assert run(["--help"]) == 0
    shown = capfd.readouterr().out
    assert all(name in shown for name in COMMANDS)
    assert "130 interrupted" in shown


def test_no_arguments_are_a_call_for_help(capfd):
    assert run([]) == 0
    shown = capfd.readouterr()
    assert "Usage: vpltune" in shown.out
    assert shown.err == ""


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_and_json(capfd, name):
    assert run([name, "--help"]) == 0
    assert "--json" in capfd.readouterr().out


def test_layers_are_those_of_the_runtime():
    assert get_args(Layer) == LAYERS


SCENE = "absent.glb"
REFUSED = {
    "no such command": (["paint"], "No such command 'paint'"),
    "no such option": (["doctor", "--fast"], "No such option: --fast"),
    "no output": (["render", SCENE], "Missing option .*--output"),
    "unknown layer": (
        ["render", SCENE, "-o", "a.png", "--layer", "beauty"],
        "'beauty' is not one of",
    ),
    "extension": (["render", SCENE, "-o", "a.jpg"], "a.jpg: the file name must end in .png or .exr"),
    "size of one": (["render", SCENE, "-o", "a.png", "--size", "640"], "--size: must be WxH with sides"),
    "size zero": (["render", SCENE, "-o", "a.png", "--size", "0x480"], "--size: must be WxH with sides"),
    "size huge": (["render", SCENE, "-o", "a.png", "--size", "16385x1"], "--size: must be WxH with sides"),
    "size negative": (["render", SCENE, "-o", "a.png", "--size", "-1x4"], "--size: must be WxH with sides"),
    "scale zero": (["render", SCENE, "-o", "a.png", "--scale", "0"], "--scale: must be a number from 1e-6"),
    "scale NaN": (["render", SCENE, "-o", "a.png", "--scale", "nan"], "--scale: must be .* got nan"),
    "view alone": (
        ["render", SCENE, "-o", "a.png", "--view", "main"],
        "--view: names a view of --views",
    ),
    "no views file": (
        ["render", SCENE, "-o", "a.png", "--views", "absent.json"],
        "absent.json: cannot be read",
    ),
    "half a camera": (["render", SCENE, "-o", "a.png", "--eye", "0,0,1"], "--eye and --look-at: a camera"),
    "no config": (["render", SCENE, "-o", "a.png", "--config", "no.json"], "no.json: cannot be read"),
    "no scene": (["render", SCENE, "-o", "a.png"], "absent.glb: "),
    "views zero": (["fit", SCENE, "-o", "out", "--views", "0"], "--views: must be from 1 to 64, or a file"),
    "bounces": (
        ["fit", SCENE, "-o", "out", "--bounces", "0"],
        '--bounces: must be "all" or a whole number from',
    ),
    "seed": (["fit", SCENE, "-o", "out", "--seed", "-1"], "Invalid value for '--seed'"),
    "export to": (["export", "default", "--to", "hlsl", "-o", "a"], "'hlsl' is not one of 'json', 'glsl'"),
    "fit size": (["fit", SCENE, "-o", "out", "--size", "64"], "--size: must be WxH with sides"),
    "no library": (["batch", "absent", "-o", "out"], "absent: cannot be read"),
    "workers": (["batch", ".", "-o", "out", "--workers", "0"], "Invalid value for '--workers'"),
    "time limit": (["batch", ".", "-o", "out", "--time-limit", "0"], "--time-limit: must be .* above 0"),
    "memory limit": (
        ["batch", ".", "-o", "out", "--memory-limit", "4T"],
        "--memory-limit: must be like 900M or 4G, got '4T'",
    ),
    "two schedulers": (
        ["batch", ".", "-o", "out", "--scheduler", "tcp://a:1", "--slurm", ""],
        "--scheduler and --slurm: only one",
    ),
    "no scenes": (["batch", ".", "-o", "out"], "has no .gltf, .glb, .obj, .ply, .xml file below it"),
    "no benchmark": (["bench", "cooking"], "bench: NAME must be one of .*, got 'cooking'"),
}


@pytest.mark.parametrize(("arguments", "message"), REFUSED.values(), ids=REFUSED)
def test_bad_input_is_one_line_and_exit_code_2(capfd, monkeypatch, tmp_path, arguments, message):
    monkeypatch.chdir(tmp_path)
    assert run(arguments) == 2
    shown = capfd.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("vpltune: ")
    assert shown.err.count("\n") == 1
    assert re.search(message, shown.err)
    assert not list(tmp_path.iterdir())


def test_a_failure_is_one_json_object_too(capfd, tmp_path):
    assert run(["export", str(tmp_path / "absent.json"), "--to", "json", "-o", "a", "--json"]) == 2
    shown = capfd.readouterr()
    document = json.loads(shown.out)
    assert document["status"] == "failed"
    assert shown.err == f"vpltune: {document['error']}\n"


def test_a_usage_error_is_one_json_object_too(capfd):
    assert run(["render", "--json"]) == 2
    assert json.loads(capfd.readouterr().out)["error"].startswith("Missing ")


def test_export_json_round_trip(capfd, tmp_path):
    assert run(export_to(tmp_path, "--json")) == 0
    document = json.loads(capfd.readouterr().out)
    assert document["status"] == "ok"
    assert read_config(document["output"]) == TunedConfig()
    assert document["parameters"] == TunedConfig().parameters.as_dict()


def test_export_glsl_of_a_file(capfd, tmp_path):
    write_config(tmp_path / "tuned.json", TunedConfig())
    arguments = ["export", str(tmp_path / "tuned.json"), "--to", "glsl", "-o", str(tmp_path / "a.glsl")]
    assert run(arguments) == 0
    assert "const float VPL_INTENSITY = 1.0;" in (tmp_path / "a.glsl").read_text()
    assert capfd.readouterr().out == f"wrote {tmp_path / 'a.glsl'}\n"


@pytest.mark.parametrize("target", [".", "file/out.json"])
def test_an_output_that_cannot_be_is_refused(capfd, monkeypatch, tmp_path, target):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("in the way")
    assert run(["export", "default", "--to", "json", "-o", target]) == 2
    assert capfd.readouterr().err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (MachineError("no OpenGL;\nrun: vpltune doctor"), 3, "vpltune: no OpenGL; run: vpltune doctor\n"),
        (MemoryError(), 3, "vpltune: not enough memory\n"),
        (
            OSError(errno.ENOSPC, "No space left on device", "a.png"),
            3,
            "vpltune: a.png: No space left on device\n",
        ),
        (
            PermissionError(errno.EACCES, "Permission denied", "a.png"),
            2,
            "vpltune: a.png: Permission denied\n",
        ),
        (KeyboardInterrupt(), 130, "vpltune: interrupted\n"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else None,
)
@pytest.mark.parametrize("as_json", [False, True])
def test_each_kind_of_failure_has_its_exit_code(capfd, monkeypatch, tmp_path, error, code, message, as_json):
    def fail(source, **options):
        raise error

    monkeypatch.setattr(vpltune.renderer.config.tuned_config, "read_config", fail)
    assert run(export_to(tmp_path, *(["--json"] if as_json else []))) == code
    shown = capfd.readouterr()
    assert shown.err == message
    if as_json:
        status = "interrupted" if code == 130 else "failed"
        assert json.loads(shown.out) == {"status": status, "error": message[len("vpltune: ") : -1]}
    else:
        assert shown.out == ""


def test_a_defect_shows_its_traceback_and_exit_code_1(capfd, monkeypatch, tmp_path):
    def fail(source, **options):
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(vpltune.renderer.config.tuned_config, "read_config", fail)
    assert run(export_to(tmp_path, "--json")) == 1
    shown = capfd.readouterr()
    assert "Traceback" in shown.err
    assert json.loads(shown.out)["error"].endswith("ZeroDivisionError: a bug")


def test_what_libraries_print_does_not_reach_stdout_with_json(capfd, monkeypatch, tmp_path):
    def chatty(config, export_format):
        print("from Python")
        os.write(1, b"from C\n")
        return b"bytes"

    monkeypatch.setattr(vpltune.renderer.export.config_export, "exported", chatty)
    assert run(export_to(tmp_path, "--json")) == 0
    shown = capfd.readouterr()
    assert json.loads(shown.out)["status"] == "ok"
    assert sorted(shown.err.split("\n")) == ["", "from C", "from Python"]


def test_the_installed_program_answers(tmp_path):
    process = start(*export_to(tmp_path, "--json"))
    out, err = process.communicate()
    assert (process.returncode, err) == (0, "")
    assert json.loads(out)["status"] == "ok"


def test_help_loads_none_of_the_heavy_libraries():
    """Half a second is the aim: the time is printed, and what it hangs on is asserted."""
    heavy = ["jax", "mitsuba", "drjit", "moderngl", "optax", "trimesh", "scipy", "PIL", "OpenEXR", "numpy"]
    code = (
        "import sys; from vpltune.cli.program import run; run(['--help']);"
        f"print([name for name in {heavy!r} if name in sys.modules])"
    )
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=REPOSITORY, capture_output=True, text=True, check=True
    )
    print(f"vpltune --help: {time.perf_counter() - begin:.2f} s")
    assert done.stdout.strip().endswith("[]")


@pytest.fixture
def heard_interrupts():
    """A shell's background jobs ignore SIGINT, and so does what they start: not while this is in use."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heard_interrupts")
def test_ctrl_c_ends_with_130_and_one_line(tmp_path):
    os.mkfifo(tmp_path / "waits.json")
    process = start("export", str(tmp_path / "waits.json"), "--to", "json", "-o", str(tmp_path / "out.json"))
    # Opening the pipe for writing returns once the program reads from it, and so is at work.
    with (tmp_path / "waits.json").open("wb"):
        process.send_signal(signal.SIGINT)
        out, err = process.communicate()
    assert (process.returncode, out, err) == (130, "", "vpltune: interrupted\n")
    assert [path.name for path in tmp_path.iterdir()] == ["waits.json"]


def test_a_reader_that_has_gone_is_no_failure(tmp_path):
    process = start(*export_to(tmp_path))
    process.stdout.close()
    process.stdout = None
    _, err = process.communicate()
    assert (process.returncode, err) == (0, "")
    assert (tmp_path / "out.json").exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
@pytest.mark.parametrize("more", [[], ["--json"]])
def test_a_full_disk_under_stdout_is_one_line_and_exit_code_3(tmp_path, more):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "vpltune", *export_to(tmp_path, *more)],
            cwd=REPOSITORY,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert done.returncode == 3
    assert done.stderr == "vpltune: standard output: No space left on device\n"


@pytest.mark.parametrize("more", [[], ["--json"]])
def test_a_closed_stdout_does_not_stop_the_work(tmp_path, more):
    command = [sys.executable, "-m", "vpltune", *export_to(tmp_path, *more)]
    done = subprocess.run(
        ["sh", "-c", 'exec "$@" >&-', "sh", *command],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "out.json").exists()
