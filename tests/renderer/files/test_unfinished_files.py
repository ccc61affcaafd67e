"""Temporary files that a killed process and its killed guard have left go with the next command."""

import subprocess
import sys
from pathlib import Path

from vpltune.renderer.files import unfinished_files
from vpltune.renderer.files.atomic_file import require_writable, written_together, written_whole

REPOSITORY = Path(__file__).resolve().parents[3]
OWNER = """
import os, sys
from pathlib import Path
from vpltune.renderer.files.atomic_file import written_together, written_whole
with written_whole(Path("x.mp4")) as file, written_together(Path()) as folder:
    file.write_text("half"), (folder / "half.txt").write_text("half")
    print("ready", flush=True)
    sys.stdin.read()
"""


def test_what_the_killed_left_goes_and_what_is_in_use_stays(tmp_path):
    """Both in one process and in two; a user's own hidden files stay."""
    (tmp_path / ".room-abc.mp4").write_text("mine")
    process = subprocess.Popen(
        [sys.executable, "-c", OWNER],
        cwd=tmp_path,
        env={"PYTHONPATH": str(REPOSITORY)},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"ready\n"
    left = set(tmp_path.glob(unfinished_files.PREFIX + "*"))
    assert len(left) == 2
    with written_whole(tmp_path / "y.mp4") as mine:
        require_writable(tmp_path)
        assert set(tmp_path.glob(unfinished_files.PREFIX + "*")) == {*left, mine}
        mine.write_text("whole")
    process.kill()
    process.communicate()
    require_writable(tmp_path / "new")
    assert sorted(path.name for path in tmp_path.iterdir()) == [".room-abc.mp4", "y.mp4"]


def test_without_locks_files_are_written_and_nothing_is_swept(tmp_path, monkeypatch):
    """Some network file systems refuse locks, and Windows has none: nobody can tell whose a file is."""

    def refuse(handle, how):
        raise OSError(38, "Function not implemented")

    for locks in (None, type("Refusing", (), {"LOCK_EX": 2, "LOCK_NB": 4, "flock": staticmethod(refuse)})):
        monkeypatch.setattr(unfinished_files, "fcntl", locks)
        old = tmp_path / f"{unfinished_files.PREFIX}old.txt"
        old.write_text("somebody's")
        with written_together(tmp_path) as folder, written_whole(folder / "x.txt") as file:
            file.write_text("whole")
        assert (tmp_path / "x.txt").read_text() == "whole"
        assert old.exists()
    assert not unfinished_files._locks
