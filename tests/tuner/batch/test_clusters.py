"""A batch on clusters: a real Dask scheduler with workers on localhost, and submitit's local executor."""

import contextlib
import os
import random
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from quick_fit import QUICK_FIT

from vpltune.cli.program import run
from vpltune.renderer.config.tuned_config import TunedConfig, write_config
from vpltune.tuner.batch.record import Records

REPOSITORY = Path(__file__).resolve().parents[3]
# Choices: kills of Dask workers and schedulers, and files in the library.
WORKER_KILLS = int(os.environ.get("VPLTUNE_WORKER_KILLS", "20"))
SCHEDULER_KILLS = int(os.environ.get("VPLTUNE_SCHEDULER_KILLS", "5"))
SCENES = 9

pytestmark = pytest.mark.slow  # several processes, each of which loads JAX


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    """Rooms that are quick to fit, and one file that is not a scene."""
    folder = tmp_path_factory.mktemp("library")
    own = sorted((REPOSITORY / "configs" / "scenes").glob("*.glb"))
    for index in range(SCENES - 1):
        content = own[index % len(own)].read_bytes()
        renamed = content.replace(b'"generator":"VPLtune', b'"generator":"VPLtun%d' % index)
        (folder / f"scene{index}.glb").write_bytes(renamed)
    (folder / "none.glb").write_bytes(b"no scene")
    write_config(folder / "small.json", TunedConfig(QUICK_FIT))
    return folder


def arguments(library, out, *more):
    small = ["--views", "1", "--size", "32x24", "--config", str(library / "small.json")]
    return ["batch", str(library), "-o", str(out), *small, *more]


class Cluster:
    """A Dask scheduler and two workers with one thread each, as separate processes."""

    def __init__(self, folder):
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self.port}"
        self._folder = folder
        self.scheduler = None
        self.workers = [None, None]

    def start_scheduler(self):
        self.scheduler = self._start(
            "dask_scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard"
        )

    def start_worker(self, index):
        place = ["--local-directory", str(self._folder / f"worker{index}")]
        self.workers[index] = self._start(
            "dask_worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard", *place
        )

    def _start(self, module, *arguments):
        with (self._folder / "cluster.log").open("ab") as log:
            return subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.{module}", *arguments],
                env={
                    **os.environ,
                    "PYTHONPATH": str(REPOSITORY),
                    "VPLTUNE_CACHE": str(self._folder / "cache"),
                },
                stdout=log,
                stderr=log,
                stdin=subprocess.DEVNULL,
                start_new_session=True,
            )

    def stop(self):
        for process in (*self.workers, self.scheduler):
            if process is not None:
                kill(process)


def kill(process):
    """Send SIGKILL to this process alone; its children have to notice by themselves."""
    process.send_signal(signal.SIGKILL)
    process.wait()


@pytest.fixture
def cluster(tmp_path):
    cluster = Cluster(tmp_path)
    cluster.start_scheduler()
    cluster.start_worker(0)
    cluster.start_worker(1)
    yield cluster
    cluster.stop()
    while tuning_processes(tmp_path):  # for ever, where one outlives its worker
        time.sleep(0.1)


def tuning_processes(folder):
    """The tuning processes that this test started."""
    found = []
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error):
            ours = process.environ().get("VPLTUNE_CACHE") == str(folder / "cache")
            if ours and "vpltune.tuner.batch.tuning_process" in process.cmdline():
                found.append(process)
    return found


def configs(out):
    records = Records(out)
    found = {}
    for key in records.known_keys():
        record = records.read(key)
        if record.status == "done":
            found[record.name] = (out / record.output / "tuned.json").read_bytes()
    return found


def test_dask_survives_kills_and_ends_with_the_same_bits(library, cluster, tmp_path):
    assert run(arguments(library, tmp_path / "local")) == 4
    whole = configs(tmp_path / "local")
    assert len(whole) == SCENES - 1
    chance = random.Random(5)
    left = ["worker"] * WORKER_KILLS + ["scheduler"] * SCHEDULER_KILLS
    chance.shuffle(left)
    batches = 0
    while left:
        out, batches = tmp_path / f"out{batches}", batches + 1
        command = [sys.executable, "-m", "vpltune", *arguments(library, out, "--scheduler", cluster.address)]
        with (tmp_path / "batch.log").open("ab") as log:
            batch = subprocess.Popen(command, cwd=REPOSITORY, stdout=log, stderr=log)
        try:
            while left and batch.poll() is None:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    batch.wait(chance.uniform(1.0, 6.0))
                    break
                if left.pop() == "worker":
                    index = chance.randrange(2)
                    kill(cluster.workers[index])
                    cluster.start_worker(index)
                else:
                    kill(cluster.scheduler)
                    cluster.start_scheduler()
                    for index in range(2):
                        kill(cluster.workers[index])
                        cluster.start_worker(index)
            assert batch.wait() == 4
        finally:
            batch.kill()
            batch.wait()
        assert configs(out) == whole
    print(f"{WORKER_KILLS} workers and {SCHEDULER_KILLS} schedulers killed in {batches} batches")


def test_a_scheduler_that_does_not_answer_is_said(library, tmp_path, monkeypatch, capfd):
    import vpltune.tuner.batch.dask_scheduler

    monkeypatch.setattr(vpltune.tuner.batch.dask_scheduler, "CONNECT_SECONDS", 0.0)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    assert run(arguments(library, tmp_path / "out", "--scheduler", address)) == 3
    assert f"no Dask scheduler answers at {address}" in capfd.readouterr().err


def test_submitit_survives_the_end_of_all_its_tasks(library, tmp_path, monkeypatch):
    """The next array tunes the scenes that the killed tasks had not finished."""
    monkeypatch.setenv("VPLTUNE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("PYTHONPATH", str(REPOSITORY))
    out = tmp_path / "out"
    command = arguments(library, out, "--slurm", "cluster=local", "--workers", "2")
    batch = subprocess.Popen([sys.executable, "-m", "vpltune", *command], cwd=REPOSITORY)
    while len(Records(out).known_keys()) < 2:
        assert batch.poll() is None
        time.sleep(0.1)
    tasks = {process.parent().pid for process in tuning_processes(tmp_path)}
    assert tasks
    for task in tasks:
        os.kill(task, signal.SIGKILL)
    assert batch.wait() == 4
    assert len(configs(out)) == SCENES - 1
    assert len(list((out / "slurm").glob("*_submitted.pkl"))) > 2
    assert run(command) == 4


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("partition", "must be KEY=VALUE separated by commas, got 'partition'"),
        ("cluster=local,colour=red", "--slurm: Parameter 'colour' need to be prefixed"),
    ],
)
def test_slurm_parameters_that_are_none_are_refused(library, tmp_path, capfd, value, message):
    assert run(arguments(library, tmp_path / "out", "--slurm", value)) == 2
    assert message in capfd.readouterr().err
