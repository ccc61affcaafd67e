"""Signals end a command at any moment: with the right code, one line, and nothing left behind."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from quick_fit import QUICK_FIT

from vpltune.renderer.config.tuned_config import TunedConfig, write_config

REPOSITORY = Path(__file__).resolve().parents[2]
ROOM = str(REPOSITORY / "configs" / "scenes" / "gallery.glb")
ENDINGS = {signal.SIGINT: (130, "interrupted"), signal.SIGTERM: (143, "terminated")}
QUICK = ["--views", "1", "--size", "32x24"]
SLEEPER = """
import os, sys, time
from pathlib import Path
from vpltune.guard import asked_to_stop, guarded
from vpltune.renderer.files.atomic_file import written_whole
def command():
    {body}
sys.exit(guarded(command, "vpltune"))
"""


def started(body, folder):
    """A guarded process that runs `body`, once it has printed a line."""
    process = subprocess.Popen(
        [sys.executable, "-c", SLEEPER.format(body=body.replace("\n", "\n    "))],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


@pytest.mark.parametrize("number", ENDINGS)
def test_a_command_that_holds_the_interpreter_is_ended(tmp_path, number):
    """Python handles no signal within this sum, which takes minutes. Its temporary file goes."""
    body = "with written_whole(Path('x.txt')):\n    print('ready', flush=True)\n    sum(range(10**11))"
    process = started(body, tmp_path)
    assert list(tmp_path.iterdir())
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    code, word = ENDINGS[number]
    assert (process.returncode, said) == (code, f"vpltune: {word}\n")
    assert not list(tmp_path.iterdir())


def test_processes_of_a_command_are_ended(tmp_path):
    """Even one that has left the command's session and inherited the pipe."""
    body = (
        "import subprocess\n"
        "from vpltune.renderer.files.unfinished_files import inherited_pipe\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)'],"
        " start_new_session=True, pass_fds=inherited_pipe())\n"
        "Path('pid').write_text(str(child.pid))\n"
        "print('ready', flush=True)\n"
        "time.sleep(600)"
    )
    process = started(body, tmp_path)
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    assert process.returncode == 143
    pid = int((tmp_path / "pid").read_text())
    assert not psutil.pid_exists(pid) or psutil.Process(pid).status() == psutil.STATUS_ZOMBIE


@pytest.mark.parametrize("number", ENDINGS)
def test_a_command_that_asks_may_end_by_itself(tmp_path, number):
    body = (
        "with asked_to_stop():\n"
        "    try:\n"
        "        print('ready', flush=True)\n"
        "        time.sleep(600)\n"
        "    except KeyboardInterrupt:\n"
        "        Path('log').write_text('told')\n"
        "        raise SystemExit(130)"
    )
    process = started(body, tmp_path)
    process.send_signal(number)
    process.communicate(timeout=60)
    assert process.returncode == ENDINGS[number][0]
    assert (tmp_path / "log").read_text() == "told"


def test_one_that_asks_and_does_not_end_is_ended(tmp_path):
    body = (
        "with asked_to_stop():\n"
        "    try:\n"
        "        print('ready', flush=True)\n"
        "        sum(range(10**11))\n"
        "    except KeyboardInterrupt:\n"
        "        sum(range(10**11))"
    )
    process = started(body, tmp_path)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (130, "vpltune: interrupted\n")


def test_a_crash_is_said(tmp_path):
    """Libraries crash; the shell's own word for it names no program, and leaves temporary files."""
    body = "with written_whole(Path('x.txt')):\n    print('ready', flush=True)\n    os.kill(os.getpid(), 11)"
    process = started(body, tmp_path)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (139, "vpltune: its process was killed by SIGSEGV\n")
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no terminals that hang up")
def test_an_ignored_signal_stays_ignored(tmp_path):
    """nohup ignores SIGHUP before the command starts."""
    body = "print('ready', flush=True)\ntime.sleep(1.0)\nPath('done').touch()\nreturn 0"
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        process = started(body, tmp_path)
    finally:
        signal.signal(signal.SIGHUP, before)
    process.send_signal(signal.SIGHUP)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) == (0, "")
    assert (tmp_path / "done").exists()


@pytest.mark.parametrize("closed", ["1", "2"])
def test_a_closed_stream_is_no_failure(tmp_path, closed):
    scene = tmp_path / "none.glb"
    scene.write_bytes(b"no scene")
    command = f"{sys.executable} -m vpltune fit {scene} -o {tmp_path / 'out'} {closed}>&-"
    done = subprocess.run(["sh", "-c", command], cwd=REPOSITORY, capture_output=True, text=True)
    assert done.returncode == 2
    assert "Traceback" not in done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("command", ["render", "fit", "batch", "report"])
def test_signals_at_any_moment(tmp_path, command):
    """25 moments of each command, half of them in its first two seconds: the right code, one line at most."""
    chance = random.Random(command)
    write_config(tmp_path / "small.json", TunedConfig(QUICK_FIT))
    small = [*QUICK, "--config", str(tmp_path / "small.json")]
    library = tmp_path / "library"
    library.mkdir()
    for name in ("gallery", "cornell-box"):
        (library / f"{name}.glb").write_bytes((REPOSITORY / f"configs/scenes/{name}.glb").read_bytes())
    if command == "report":
        fit = [sys.executable, "-m", "vpltune", "fit", ROOM, "-o", str(tmp_path / "fitted"), *small]
        subprocess.run(fit, cwd=REPOSITORY, check=True, capture_output=True)
    commands = {
        "render": ["render", ROOM, "-o", str(tmp_path / "x.mp4"), "--frames", "200", "--size", "64x48"],
        "fit": ["fit", ROOM, "-o", str(tmp_path / "out"), *small],
        "batch": ["batch", str(library), "-o", str(tmp_path / "out"), *small],
        "report": ["report", str(tmp_path / "fitted")],
    }
    ended = {0: 0, 130: 0, 143: 0}
    for moment in range(25):
        number = chance.choice(list(ENDINGS))
        environment = {**os.environ, "VPLTUNE_CACHE": str(tmp_path / f"cache{moment}")}
        process = subprocess.Popen(
            [sys.executable, "-m", "vpltune", *commands[command]],
            cwd=REPOSITORY,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        # Python itself takes some 50 ms to come to the first line of main.
        time.sleep(0.1 + (chance.uniform(0.0, 2.0) if moment % 2 else chance.uniform(2.0, 8.0)))
        descendants = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(number)
        asked = time.perf_counter()
        _, said = process.communicate(timeout=120)
        late = time.perf_counter() - asked
        code, word = ENDINGS[number]
        assert process.returncode in (0, code), said
        ended[process.returncode] += 1
        assert "Traceback" not in said
        if process.returncode:
            last = said.splitlines()[-1]
            assert last in (f"vpltune: {word}", "vpltune: interrupted"), said
        left = [each for each in descendants if each.is_running() and each.status() != "zombie"]
        assert not left
        temporaries = [path for path in tmp_path.rglob(".*") if path.is_file() and "cache" not in str(path)]
        assert not temporaries
        print(f"{command} {moment}: {number.name} ended it with {process.returncode} after {late:.2f} s")
    assert ended[130] and ended[143]
