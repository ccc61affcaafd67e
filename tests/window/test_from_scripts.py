"""Programs of any form open a window: a script without a main guard, and one that Python reads from stdin."""

import subprocess
import sys

import pytest

SCRIPT = """
import os, signal, sys, vpltune
print("runs", flush=True)
window = vpltune.view(sys.argv[1], sys.argv[2])
signal.signal(signal.SIGINT, lambda *_: None)
os.killpg(0, signal.SIGINT)  # as a terminal does, and a notebook that interrupts a cell
print(len(window.lights), flush=True)
"""
"""It neither guards its main module nor closes the window."""


@pytest.mark.parametrize("from_stdin", [False, True])
def test_a_script_runs_once_and_its_window_outlives_an_interrupt(
    own_cache, tmp_path, scene_file, config_file, from_stdin
):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    ended = subprocess.run(
        [sys.executable, "-" if from_stdin else script, scene_file, config_file],
        input=SCRIPT if from_stdin else "",
        cwd=tmp_path,
        capture_output=True,
        text=True,
        start_new_session=True,
    )
    assert (ended.returncode, ended.stderr) == (0, "")
    assert [line for line in ended.stdout.splitlines() if line in ("runs", "1")] == ["runs", "1"]
