"""A tuning process that exceeds a limit or dies is replaced, and its scene is recorded as failed."""

import json
import math
import os
import re
import signal
import subprocess
import sys
import threading
import time
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest

from vpltune.cli.program import run
from vpltune.renderer.errors import MachineError
from vpltune.renderer.gpu import gpu_context
from vpltune.tuner.batch import tuning_process
from vpltune.tuner.batch.attempts import tune_with_retries
from vpltune.tuner.batch.local_scheduler import tune_locally
from vpltune.tuner.batch.supervised_process import Limits, StoppedError, SupervisedProcess, memory_of

# Runs in place of the tuning process. The name of a job says what it does.
STAND_IN = """
import os, sys, threading, time
from multiprocessing.connection import Connection
from vpltune.tuner.batch.job import Job
from vpltune.tuner.batch.messages import receive, send
from vpltune.tuner.batch.tuning_process import _die_with_parent
threading.Thread(target=_die_with_parent, daemon=True).start()
connection = Connection(int(sys.argv[1]))
send(connection, {"ready": True})
while True:
    order = receive(connection)
    does = Job.from_json(order["job"]).name
    send(connection, {"stage": "fit", "share": 0.5})
    if does == "sleep":
        time.sleep(600)
    elif does == "grow":
        kept = bytearray(os.urandom(1 << 20)) * 200
        time.sleep(600)
    elif does == "die":
        print("out of luck", file=sys.stderr, flush=True)
        os.abort()
    elif does == "leave":
        os._exit(7)
    elif does == "no machine":
        send(connection, {"machine_error": "no OpenGL"})
    elif does == "too large":
        send(connection, {"failed": "the GPU ran out of memory", "renew": True})
    elif does == "second time" and order["attempt"] == 1:
        send(connection, {"failed": "ValueError: once"})
    else:
        send(connection, {"busy": True})
"""

PLENTY = Limits(math.inf, 4 << 30, 0)  # a choice: never exceeded here, and no retries


@pytest.fixture
def supervised(tmp_path, monkeypatch):
    (tmp_path / "stand_in.py").write_text(STAND_IN)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", ""), "."]))
    process = SupervisedProcess(1, threading.Event(), module="stand_in")
    yield process
    process.close()


@pytest.mark.parametrize(
    ("does", "limits", "reason"),
    [
        ("sleep", Limits(0.5, 4 << 30, 0), "it took longer than the limit of 0.5 s"),
        ("grow", Limits(math.inf, 100 << 20, 0), "more than the limit of 100 MiB"),
        ("die", PLENTY, r"its process was killed by SIGABRT \(out of luck\)"),
        ("leave", PLENTY, "its process ended with exit code 7"),
    ],
)
def test_a_scene_that_misbehaves_is_set_aside_and_the_next_is_served(
    supervised, make_job, does, limits, reason
):
    events = []
    record = tune_with_retries(supervised, make_job(does), limits, events.append)
    assert (record.status, record.attempts) == ("failed", 1)
    assert re.search(reason, record.reason)
    assert [event["event"] for event in events] == ["stage", "attempt_failed"]
    assert tune_with_retries(supervised, make_job("next"), PLENTY, events.append) is None


def test_every_retry_is_made_and_the_last_reason_kept(supervised, make_job):
    events = []
    record = tune_with_retries(supervised, make_job("leave"), Limits(math.inf, 4 << 30, 3), events.append)
    assert record.attempts == 4
    assert [e["attempt"] for e in events if e["event"] == "attempt_failed"] == [1, 2, 3, 4]


def test_a_limit_passed_twice_is_not_tried_again(supervised, make_job):
    record = tune_with_retries(supervised, make_job("sleep"), Limits(0.3, 4 << 30, 3), lambda event: None)
    assert (record.status, record.attempts) == ("failed", 2)


def test_a_second_attempt_may_succeed(supervised, make_job):
    events = []
    job = make_job("second time")
    assert tune_with_retries(supervised, job, Limits(math.inf, 4 << 30, 3), events.append) is None
    assert [e["reason"] for e in events if e["event"] == "attempt_failed"] == ["ValueError: once"]


def test_a_machine_that_lacks_something_is_no_scenes_fault(supervised, make_job):
    with pytest.raises(MachineError, match="no OpenGL"):
        tune_with_retries(supervised, make_job("no machine"), PLENTY, lambda event: None)


@pytest.fixture
def outcome_of(make_job, fits):
    """What the tuning process answers where a fit raises `error`."""

    def outcome(error: str) -> dict:
        fits.error = MachineError(error)
        ours, theirs = Pipe()
        with ours, theirs:
            return tuning_process._outcome(theirs, make_job(), 1)

    return outcome


def test_a_scene_too_large_for_this_gpu_fails_alone(outcome_of, monkeypatch):
    made = []
    context = SimpleNamespace(release=lambda: made.append("released"))
    monkeypatch.setattr(gpu_context, "create_context", lambda: context)
    failed = outcome_of("the depth texture: out of memory")
    assert failed == {"failed": "the depth texture: out of memory", "renew": True}
    assert made == ["released"]  # that a context can be made says that other scenes can be fitted


def test_what_ends_every_fit_ends_the_batch(outcome_of, monkeypatch, make_job):
    full = f"{make_job().folder}/scenes/a/tuned.json: cannot be written (No space left on device)"
    assert outcome_of(full) == {"machine_error": full}

    def no_context():
        raise MachineError("no OpenGL")

    monkeypatch.setattr(gpu_context, "create_context", no_context)
    assert outcome_of("GL_OUT_OF_MEMORY") == {"machine_error": "GL_OUT_OF_MEMORY"}


def test_the_scene_after_one_too_large_has_a_process_of_its_own(supervised, make_job):
    supervised.attempt(make_job("next"), 1, PLENTY, lambda stage, share: None)
    first = supervised._process.pid
    failed = supervised.attempt(make_job("too large"), 1, PLENTY, lambda stage, share: None)
    assert (failed.record, failed.failure) == (None, "the GPU ran out of memory")
    supervised.attempt(make_job("next"), 1, PLENTY, lambda stage, share: None)
    assert supervised._process.pid != first


def test_stopping_ends_the_process(supervised, make_job):
    threading.Timer(1.0, supervised._stopped.set).start()
    with pytest.raises(StoppedError):
        supervised.attempt(make_job("sleep"), 1, PLENTY, lambda stage, share: None)
    assert supervised._process is None


def test_a_process_that_has_grown_large_is_replaced_before_the_next_scene(supervised, make_job):
    supervised.attempt(make_job("next"), 1, PLENTY, lambda stage, share: None)
    first = supervised._process.pid
    supervised.attempt(make_job("next"), 1, PLENTY, lambda stage, share: None)
    assert supervised._process.pid == first
    tight = Limits(math.inf, int(1.5 * memory_of(psutil.Process(first))), 0)
    supervised.attempt(make_job("next"), 1, tight, lambda stage, share: None)
    assert supervised._process.pid != first
    assert not psutil.pid_exists(first)


PARENT = """
import sys, threading
from pathlib import Path
from vpltune.tuner.batch.job import Job
from vpltune.tuner.batch.supervised_process import Limits, SupervisedProcess
process = SupervisedProcess(1, threading.Event(), module="stand_in")
def progress(stage, share):
    print(process._process.pid, flush=True)
process.attempt(Job.from_json(Path(sys.argv[1]).read_text()), 1, Limits(float('inf'), 4 << 30), progress)
"""


def test_the_process_dies_with_its_parent(supervised, make_job, tmp_path):
    (tmp_path / "job.json").write_text(make_job("sleep").to_json())
    command = [sys.executable, "-c", PARENT, str(tmp_path / "job.json")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as parent:
        child = int(parent.stdout.readline())
        assert psutil.pid_exists(child)
        parent.send_signal(signal.SIGKILL)
    while psutil.pid_exists(child):  # for ever, where it outlives its parent
        time.sleep(0.05)


def test_refused_scenes_get_a_record_each_from_real_processes(make_job):
    """Two real tuning processes get files that are not scenes: no retries, and no claims left."""
    jobs = [make_job(f"room{index}.glb") for index in range(5)]
    # An earlier test may have left the driver of a browser.
    before = set(psutil.Process().children(recursive=True))
    events = list(tune_locally(jobs, 2, 1, Limits(math.inf, 8 << 30)))
    records = [event for event in events if event["event"] == "record"]
    assert {record["status"] for record in records} == {"refused"}
    assert {record["attempts"] for record in records} == {1}
    assert sorted(record["name"] for record in records) == [job.name for job in jobs]
    assert not list((Path(jobs[0].folder) / "claims").iterdir())
    assert set(psutil.Process().children(recursive=True)) <= before


def test_the_command_refuses_resumes_and_reports(tmp_path, capfd):
    """The command itself gets files that are not scenes: exit code 4, and nothing to do the second time."""
    library = tmp_path / "library"
    library.mkdir()
    for index in range(3):
        (library / f"{index}.glb").write_bytes(b"no scene" * (1 + index // 2 * index))
    arguments = ["batch", str(library), "-o", str(tmp_path / "out"), "--json", "--workers", "1"]
    assert run(arguments) == 4
    first = json.loads(capfd.readouterr().out)
    assert (first["status"], first["refused"], first["fitted"]) == ("partly done", 2, 2)
    assert first["copies"] == {"1.glb": "0.glb"}
    assert run(arguments) == 4
    shown = capfd.readouterr()
    assert json.loads(shown.out) == first | {"fitted": 0}
    assert shown.err == "vpltune: 0 scenes to tune, 2 have a record\n"
