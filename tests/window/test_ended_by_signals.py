"""A signal ends the command with one line, whatever its processes do at that moment."""

import os
import signal
import subprocess
import sys

import psutil
import pytest
from window_talk import Talk


@pytest.mark.parametrize(
    ("number", "code", "line"),
    [(signal.SIGINT, 130, "vpltune: interrupted\n"), (signal.SIGTERM, 143, "vpltune: terminated\n")],
)
def test_a_signal_to_all_processes_ends_the_window_with_one_line(
    own_cache, tmp_path, monkeypatch, scene_file, config_file, number, code, line
):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    before = set(tmp_path.iterdir())
    with subprocess.Popen(
        [sys.executable, "-m", "vpltune", "view", scene_file, "--config", config_file],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as command:
        assert command.stdout is not None
        address = command.stdout.readline().strip()
        everyone = psutil.Process(command.pid).children(recursive=True)
        with Talk(address) as talk:
            talk.shown()
            talk.say("save", what="views", path=str(tmp_path / "views.json"))
            talk.message("notice")
            # As a terminal does: the process that draws hears it too.
            os.killpg(command.pid, number)
            _, said = command.communicate()
        _, alive = psutil.wait_procs(everyone, timeout=60)
    assert (command.returncode, said, alive) == (code, line, [])
    assert {path.name for path in set(tmp_path.iterdir()) - before} <= {"views.json", "cache"}
