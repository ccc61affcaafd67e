"""Signals end a command at any moment: with the right code, one line, and nothing left behind.

A command that is not ended works or waits on. What works has `MOST_SECONDS` of processor time; nothing
bounds how long a test waits, since another load may make anything late.
"""

import contextlib
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
MOST_SECONDS = 60
"""Processor time of a guarded process, beyond which it is killed by SIGXCPU. A choice."""
SLEEPER = """
import os, resource, signal, sys, time
from pathlib import Path
from vpltune import guard
from vpltune.guard import asked_to_stop, guarded
from vpltune.renderer.files.atomic_file import written_whole
resource.setrlimit(resource.RLIMIT_CPU, ({limit}, {limit}))
def command():
    {body}
sys.exit(guarded(command, "vpltune"))
"""


def started(body, folder, closed=""):
    """A guarded process that runs `body`, once it has printed a line; `closed` closes streams of it."""
    program = SLEEPER.format(body=body.replace("\n", "\n    "), limit=MOST_SECONDS)
    process = subprocess.Popen(
        ["sh", "-c", f'exec "$@" {closed}', "sh", sys.executable, "-c", program],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


def wait_until_gone(process):
    """Until a killed process has ended, which may take the kernel a while."""
    with contextlib.suppress(psutil.NoSuchProcess):
        while process.is_running() and process.status() != psutil.STATUS_ZOMBIE:
            time.sleep(0.01)


def wait_until_worked(process, seconds):
    """Until the processes of a command have taken `seconds` of processor time, or it is done."""
    guard = psutil.Process(process.pid)
    while process.poll() is None:
        with contextlib.suppress(psutil.Error):
            # Python takes a while to come to the first line of main; a guard has a child.
            taken = [sum(each.cpu_times()[:2]) for each in guard.children(recursive=True)]
            if taken and sum(taken) >= seconds:
                return
        time.sleep(0.01)


@pytest.mark.parametrize("number", ENDINGS)
def test_a_command_that_holds_the_interpreter_is_ended(tmp_path, number):
    """Python handles no signal within this sum, which takes minutes. Its temporary file goes."""
    body = "with written_whole(Path('x.txt')):\n    print('ready', flush=True)\n    sum(range(10**11))"
    process = started(body, tmp_path)
    assert list(tmp_path.iterdir())
    process.send_signal(number)
    _, said = process.communicate()
    code, word = ENDINGS[number]
    assert (process.returncode, said) == (code, f"vpltune: {word}\n")
    assert not list(tmp_path.iterdir())


def test_processes_of_a_command_are_ended(tmp_path):
    """Even one that has left the command's session and inherited the pipe."""
    body = (
        "import subprocess\n"
        "from vpltune.renderer.files.unfinished_files import inherited_pipe\n"
        "child = subprocess.Popen([sys.executable, '-c', 'import signal; signal.pause()'],"
        " start_new_session=True, pass_fds=inherited_pipe())\n"
        "Path('pid').write_text(str(child.pid))\n"
        "print('ready', flush=True)\n"
        "signal.pause()"
    )
    process = started(body, tmp_path)
    process.send_signal(signal.SIGTERM)
    process.communicate()
    assert process.returncode == 143
    with contextlib.suppress(psutil.NoSuchProcess):
        wait_until_gone(psutil.Process(int((tmp_path / "pid").read_text())))


@pytest.mark.parametrize("number", ENDINGS)
def test_a_command_that_asks_may_end_by_itself(tmp_path, number):
    body = (
        "guard.PATIENCE_SECONDS = 1e9\n"
        "with asked_to_stop():\n"
        "    try:\n"
        "        print('ready', flush=True)\n"
        "        signal.pause()\n"
        "    except KeyboardInterrupt:\n"
        "        Path('log').write_text('told')\n"
        "        raise SystemExit(130)"
    )
    process = started(body, tmp_path)
    process.send_signal(number)
    process.communicate()
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
    _, said = process.communicate()
    assert (process.returncode, said) == (130, "vpltune: interrupted\n")


def test_a_crash_is_said(tmp_path):
    """Libraries crash; the shell's own word for it names no program, and leaves temporary files."""
    body = "with written_whole(Path('x.txt')):\n    print('ready', flush=True)\n    os.kill(os.getpid(), 11)"
    process = started(body, tmp_path)
    _, said = process.communicate()
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
    _, said = process.communicate()
    assert (process.returncode, said) == (0, "")
    assert (tmp_path / "done").exists()


def test_no_file_stands_in_for_a_closed_stream(tmp_path):
    """What a library says on standard error must get into no file, and into no pipe of the guard."""
    body = (
        "files = [Path(f'{number}.txt').open('w') for number in range(4)]\n"
        "os.write(2, b'a remark')\n"
        "print('ready', flush=True)\n"
        "return 0"
    )
    process = started(body, tmp_path, "<&- 2>&-")
    process.communicate()
    assert process.returncode == 0
    assert [path.read_text() for path in tmp_path.iterdir()] == [""] * 4


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends a child with its parent")
def test_a_command_ends_with_a_killed_guard(tmp_path):
    """Its temporary file stays, and goes with the next command (tests/renderer/files)."""
    body = "Path('pid').write_text(str(os.getpid()))\nprint('ready', flush=True)\nsignal.pause()"
    process = started(body, tmp_path)
    process.kill()
    process.communicate()
    with contextlib.suppress(psutil.NoSuchProcess):
        wait_until_gone(psutil.Process(int((tmp_path / "pid").read_text())))


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
    """25 moments of each command, half of them in its first two seconds of processor time: the right code,
    one line at most."""
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
        wait_until_worked(process, chance.uniform(0.0, 2.0) if moment % 2 else chance.uniform(2.0, 8.0))
        descendants = []
        with contextlib.suppress(psutil.NoSuchProcess):
            descendants = psutil.Process(process.pid).children(recursive=True)
        process.send_signal(number)
        asked = time.perf_counter()
        _, said = process.communicate()
        late = time.perf_counter() - asked
        code, word = ENDINGS[number]
        assert process.returncode in (0, code), said
        ended[process.returncode] += 1
        assert "Traceback" not in said
        if process.returncode:
            last = said.splitlines()[-1]
            assert last in (f"vpltune: {word}", "vpltune: interrupted"), said
        for each in descendants:
            wait_until_gone(each)
        temporaries = [path for path in tmp_path.rglob(".*") if path.is_file() and "cache" not in str(path)]
        assert not temporaries
        print(f"{command} {moment}: {number.name} ended it with {process.returncode} after {late:.2f} s")
    assert ended[130] and ended[143]
