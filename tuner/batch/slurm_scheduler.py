"""Scheduler for a Slurm cluster, through submitit: an array of tasks shares the scenes.

Slurm only runs the tasks; progress is read from the records on disk. A preempted task is queued again and
continues. Scenes of a task that died go into another array.
"""

import os
import sys
import threading
import time
import uuid
from collections.abc import Generator, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

# submitit's set-up of logging closes the handlers of everybody else, absl's with its stream, and prints to
# standard output.
os.environ.setdefault("SUBMITIT_LOG_LEVEL", "NOCONFIG")
import submitit

from vpltune.renderer.errors import InputError, MachineError
from vpltune.tuner.batch.attempts import tune_with_retries
from vpltune.tuner.batch.job import Job, read_jobs, write_jobs
from vpltune.tuner.batch.record import Records
from vpltune.tuner.batch.supervised_process import UNLIMITED_BYTES, Limits, SupervisedProcess

POLL_SECONDS = 2.0
"""Interval between two checks of the tasks and records. A choice."""
ENDING_SECONDS = 10.0
"""Time for the tasks to end by themselves once all scenes are done. A choice."""
LEAST_MINUTES = 60
"""Shortest time limit that is requested for a task if `timeout_min` is not given. A choice."""
MOST_MINUTES = 24 * 60
"""Longest time limit that is requested for a task if `timeout_min` is not given. A choice."""
GUESSED_MINUTES = 1.0
"""Minutes per scene in that time limit. A choice."""

Event = dict[str, Any]


class TuneShare(submitit.helpers.Checkpointable):
    """One task: it tunes its own share of the scenes, then any scenes of other tasks without a record.

    After an interruption it is called again and skips the scenes that have a record.

    Args:
        listing: File with all jobs, see `write_jobs`.
        first: Index of the first job of this task's share.
        step: Every `step`-th job from `first` on belongs to the share.
        threads: Threads for each library of a fit.
        limits: Limits of each attempt.
    """

    def __init__(self, listing: Path, first: int, step: int, threads: int, limits: Limits) -> None:
        self._listing = listing
        self._first = first
        self._step = step
        self._threads = threads
        self._limits = limits

    def __call__(self) -> None:
        jobs = read_jobs(self._listing)
        process = SupervisedProcess(self._threads, threading.Event())
        try:
            for job in jobs[self._first :: self._step]:
                self._tune(process, job)
            known = Records(Path(jobs[0].folder)).known_keys()
            # Start at this task's first job, so that tasks that run out of work do not all try the same
            # scene. A scene that another task or run has claimed is skipped.
            for job in jobs[self._first :] + jobs[: self._first]:
                if job.key not in known:
                    self._tune(process, job)
        finally:
            process.close()

    def _tune(self, process: SupervisedProcess, job: Job) -> None:
        def say(event: Event) -> None:
            if event["event"] == "attempt_failed":  # goes to the log of the task
                print(f"{event['name']}: attempt {event['attempt']}: {event['reason']}", file=sys.stderr)

        tune_with_retries(process, job, self._limits, say)


def tune_on_slurm(
    jobs: Sequence[Job], options: dict[str, Any], workers: int, threads: int, limits: Limits
) -> Generator[Event, None, None]:
    """Tune `jobs` in arrays of at most `workers` tasks, and yield events.

    Every job ends with a `record` event. If the iterator is closed early, every task is cancelled.

    Args:
        jobs: What to tune; at least one.
        options: Parameters for submitit's executor.
        workers: Tasks at a time.
        threads: Threads for each library of a fit.
        limits: Limits of each attempt.

    Raises:
        InputError: submitit rejects the options.
        MachineError: Slurm was not found, no task can fit anything, or a whole array ended without a record.
    """
    folder = Path(jobs[0].folder)
    executor = _executor(folder / "slurm", options, workers, threads, limits, len(jobs))
    left = {job.key: job for job in jobs}
    while left:
        before = len(left)
        yield from _one_array(executor, Records(folder), left, workers, threads, limits)
        if len(left) == before:
            raise MachineError(
                f"--slurm: every task ended without a record; see the logs in {folder / 'slurm'}"
            )


def _one_array(
    executor: "submitit.AutoExecutor",
    records: Records,
    left: dict[str, Job],
    workers: int,
    threads: int,
    limits: Limits,
) -> Iterator[Event]:
    # Jobs are sorted by size and dealt like cards, so the shares are about even.
    jobs = list(left.values())
    count = min(workers, len(jobs))
    listing = Path(jobs[0].folder) / "slurm" / f"jobs-{uuid.uuid4().hex[:8]}.json"
    write_jobs(listing, jobs)
    with executor.batch():
        tasks = [executor.submit(TuneShare(listing, first, count, threads, limits)) for first in range(count)]
    yield {"event": "workers", "count": len(tasks)}
    try:
        running = True
        while left and running:
            time.sleep(POLL_SECONDS)
            # Check this before reading the records: then no record of a task that has ended is missed below.
            running = not all(task.done() for task in tasks)
            for key in records.known_keys() & left.keys():
                record = records.read(key)
                if record is not None:
                    del left[key]
                    yield {"event": "record", **asdict(record)}
        until = time.monotonic() + ENDING_SECONDS
        while not all(task.done() for task in tasks) and time.monotonic() < until:
            time.sleep(0.1)
        for task in tasks:
            error = task.exception() if task.done() and left else None
            if error is not None and "MachineError" in str(error):
                raise MachineError(f"--slurm: task {task.job_id}: {str(error).strip().splitlines()[-1]}")
    finally:
        for task in tasks:
            if not task.done():
                task.cancel(check=False)


def _executor(
    folder: Path, options: dict[str, Any], workers: int, threads: int, limits: Limits, count: int
) -> "submitit.AutoExecutor":
    minutes = min(max(LEAST_MINUTES, int(GUESSED_MINUTES * count / workers)), MOST_MINUTES)
    settings = {"name": "vpltune", "cpus_per_task": threads, "timeout_min": minutes, **options}
    cluster = settings.pop("cluster", None)
    if cluster in (None, "slurm"):
        settings.setdefault("slurm_array_parallelism", workers)
    if limits.memory_bytes < UNLIMITED_BYTES:
        settings.setdefault("mem_gb", -(-limits.memory_bytes // 2**30))
    try:
        executor = submitit.AutoExecutor(folder=folder, cluster=cluster)
        if cluster is None and executor.cluster != "slurm":
            raise MachineError("--slurm: Slurm was not found (srun is not on the PATH)")
        executor.update_parameters(**settings)
    except (TypeError, ValueError, NameError, RuntimeError, AssertionError) as error:
        if isinstance(error, MachineError):
            raise
        raise InputError(f"--slurm: {error}") from error
    return executor
