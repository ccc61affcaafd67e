"""Retry one scene until it has a record, or record it as failed with the reason of the last attempt."""

import threading
from collections.abc import Callable
from typing import Any

from vpltune.tuner.batch.job import Job
from vpltune.tuner.batch.record import Record
from vpltune.tuner.batch.supervised_process import Limits, SupervisedProcess
from vpltune.tuner.batch.tune_one import set_aside

MOST_PASSED = 2
"""Attempts that may exceed a limit before the scene is given up. A choice: a scene that was too large or too
slow twice would be so again, and other scenes would have to wait."""

Report = Callable[[dict[str, Any]], None]
"""Called with each event: `{"event": "attempt_failed", …}` or `{"event": "stage", …}`."""


def tune_with_retries(process: SupervisedProcess, job: Job, limits: Limits, report: Report) -> Record | None:
    """Fit the scene of `job` and return its record; None if another process is working on it.

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
    """`tune_with_retries` in a process that belongs to the calling thread and is kept for its next scene."""
    process = getattr(_of_this_thread, "process", None)
    if process is None:
        process = _of_this_thread.process = SupervisedProcess(threads, threading.Event())
    return tune_with_retries(process, job, limits, report)
