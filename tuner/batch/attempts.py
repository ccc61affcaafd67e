"""All attempts at one scene: until it has a record, or is set aside with the reason of the last."""

import threading
from collections.abc import Callable
from typing import Any

from vpltune.tuner.batch.job import Job
from vpltune.tuner.batch.record import Record
from vpltune.tuner.batch.supervised_process import Limits, SupervisedProcess
from vpltune.tuner.batch.tune_one import set_aside

MOST_PASSED = 2
"""Attempts that may pass a limit: a scene too large or too slow twice is so again, and others would wait."""

Report = Callable[[dict[str, Any]], None]
"""Called with events: `{"event": "attempt_failed", …}`, `{"event": "stage", …}`."""


def tune_with_retries(process: SupervisedProcess, job: Job, limits: Limits, report: Report) -> Record | None:
    """The record of `job`; None while another process is at work on it.

    Raises:
        MachineError: this machine cannot fit anything.
        StoppedError: the batch was stopped.
    """

    def progress(stage: str, share: float) -> None:
        report({"event": "stage", "key": job.key, "name": job.name, "stage": stage, "share": share})

    passed = 0
    for number in range(1, limits.retries + 2):
        attempt = process.attempt(job, number, limits, progress)
        if attempt.record is not None or not attempt.failure:
            return attempt.record
        report(
            {
                "event": "attempt_failed",
                "key": job.key,
                "name": job.name,
                "attempt": number,
                "seconds": attempt.seconds,
                "reason": attempt.failure,
            }
        )
        passed += attempt.limit_passed
        if passed == MOST_PASSED:
            break
    return set_aside(job, attempt.failure, number, attempt.seconds)


_of_this_thread = threading.local()


def tune_in_own_process(job: Job, limits: Limits, threads: int, report: Report) -> Record | None:
    """The same, with a process that belongs to the calling thread and serves its next scene too."""
    process = getattr(_of_this_thread, "process", None)
    if process is None:
        process = _of_this_thread.process = SupervisedProcess(threads, threading.Event())
    return tune_with_retries(process, job, limits, report)
