"""Kill the whole process tree at random times: every batch resumes and ends with bit-identical configs."""

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
from vpltune.tuner.batch.record import Records

REPOSITORY = Path(__file__).resolve().parents[3]
# Choices: kills in all, and scenes in the library.
KILLS = int(os.environ.get("VPLTUNE_KILLS", "50"))
SCENES = 6

pytestmark = pytest.mark.slow  # takes minutes: each run loads JAX and really fits scenes


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """Scenes that are quick to fit: three rooms, each twice, with different bytes in the header."""
    folder = tmp_path_factory.mktemp("library")
    own = sorted((REPOSITORY / "configs" / "scenes").glob("*.glb"))
    for index in range(SCENES):
        content = own[index % len(own)].read_bytes()
        renamed = content.replace(b'"generator":"VPLtune', b'"generator":"VPLtun%d' % index)
        assert renamed != content
        (folder / f"scene{index}.glb").write_bytes(renamed)
    write_config(folder / "small.json", TunedConfig(QUICK_FIT))
    return folder


def start_batch(library, folder):
    command = [
        sys.executable,
        "-m",
        "vpltune",
        "batch",
        str(library),
        "-o",
        str(folder / "out"),
        "--workers",
        "2",
    ]
    command += ["--views", "1", "--size", "32x24", "--config", str(library / "small.json"), "--json"]
    return subprocess.Popen(
        command,
        cwd=REPOSITORY,
        env={**os.environ, "VPLTUNE_CACHE": str(folder / "cache")},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )


def kill_tree(process):
    """Send SIGKILL to a process and all its descendants, the root first, like a power failure."""
    members = [process, *psutil.Process(process.pid).children(recursive=True)]
    for member in members:
        with contextlib.suppress(psutil.NoSuchProcess):
            member.send_signal(signal.SIGKILL)
    process.communicate()
    psutil.wait_procs(members[1:])


def finished(folder):
    """Tuned configs by scene; and by key, the mtimes of the record and its config."""
    records = Records(folder / "out")
    configs, stamps = {}, {}
    for key in records.known_keys():
        record = records.read(key)
        assert record is not None
        assert record.status == "done", record
        config = folder / "out" / record.output / "tuned.json"
        configs[record.name] = config.read_bytes()
        stamps[key] = (records.path(key).stat().st_mtime_ns, config.stat().st_mtime_ns)
    return configs, stamps


def assert_tidy(folder):
    assert list(folder.rglob(".*")) == []
    assert list((folder / "out" / "claims").iterdir()) == []
    assert {path.suffix for path in (folder / "cache" / "references").iterdir()} == {".reference"}


def run_through(library, folder):
    process = start_batch(library, folder)
    process.communicate()
    assert process.returncode == 0
    assert_tidy(folder)
    return finished(folder)


def test_killed_anywhere_it_resumes_to_the_same_bits(library, tmp_path):
    whole, _ = run_through(library, tmp_path / "whole")
    assert len(whole) == SCENES
    chance = random.Random(KILLS)
    kills, passes, interrupted = 0, 0, 0
    while kills < KILLS:
        folder, passes = tmp_path / f"pass{passes}", passes + 1
        stamps = {}
        while kills < KILLS:
            process = start_batch(library, folder)
            try:
                process.wait(chance.uniform(0.2, 9.0))
                break
            except subprocess.TimeoutExpired:
                kill_tree(process)
            kills += 1
            _, now = finished(folder) if (folder / "out").exists() else ({}, {})
            # No scene with a record was tuned again.
            assert {key: now[key] for key in stamps} == stamps
            interrupted += len(now) < SCENES
            stamps = now
        configs, now = run_through(library, folder)
        assert configs == whole
        assert {key: now[key] for key in stamps} == stamps
    print(f"{kills} kills in {passes} libraries, {interrupted} with scenes still to be done")
    assert interrupted > KILLS // 2


def test_two_runs_at_once_share_the_scenes(library, tmp_path):
    """Neither run fits a scene that the other has claimed, and both end with all records."""
    both = [start_batch(library, tmp_path) for _ in range(2)]
    for process in both:
        process.communicate()
        assert process.returncode == 0
    assert len(finished(tmp_path)[0]) == SCENES
    assert_tidy(tmp_path)


def test_ctrl_c_ends_with_130_and_no_process_left(library, tmp_path):
    process = start_batch(library, tmp_path)
    children = []
    while len(children) < 2:  # the command itself, and a process that fits
        assert process.poll() is None
        time.sleep(0.1)
        children = psutil.Process(process.pid).children(recursive=True)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate()
    assert process.returncode == 130
    assert b'"interrupted"' in out
    for child in children:
        with contextlib.suppress(psutil.NoSuchProcess):
            # A dead child may remain as a zombie until its new parent reaps it.
            while child.is_running() and child.status() != psutil.STATUS_ZOMBIE:
                time.sleep(0.1)
