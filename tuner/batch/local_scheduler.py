"""Scheduler for one machine: a few tuning processes, each supervised by a thread."""

import queue
import threading
from collections.abc import Generator, Sequence
from dataclasses import asdict
from typing import Any

from vpltune.tuner.batch.attempts import tune_with_retries
from vpltune.tuner.batch.job import Job
from vpltune.tuner.batch.supervised_process import Limits, StoppedError, SupervisedProcess

BUSY_SECONDS = 1.0
"""Pause before a scene that another run is working on is tried again. A choice."""

Event = dict[str, Any]


def tune_locally(
    jobs: Sequence[Job], workers: int, threads: int, limits: Limits
) -> Generator[Event, None, None]:
    """Tune `jobs`, started in the given order, and yield events. Every job ends with a `record` event.

    If the iterator is closed early or raises, every process that it started is ended.

    Args:
        jobs: What to tune.
        workers: Scenes to fit at a time.
        threads: Threads for each library of a fit.
        limits: Limits of each attempt.

    Raises:
        MachineError: this machine cannot fit anything.
    """
    waiting: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
    events: queue.SimpleQueue[Event | BaseException] = queue.SimpleQueue()
    stopped = threading.Event()
    for job in jobs:
        waiting.put(job)
    crew = [
        threading.Thread(target=_serve, args=(waiting, events, stopped, threads, limits), daemon=True)
        for _ in range(min(workers, len(jobs)))
    ]
    for thread in crew:
        thread.start()
    left = len(jobs)
    try:
        while left:
            event = events.get()
            if isinstance(event, BaseException):
                raise event
            left -= event["event"] == "record"
            yield event
    finally:
        stopped.set()
        for _ in crew:
            waiting.put(None)
        for thread in crew:
            thread.join()


def _serve(
    waiting: "queue.SimpleQueue[Job | None]",
    events: "queue.SimpleQueue[Event | BaseException]",
    stopped: threading.Event,
    threads: int,
    limits: Limits,
) -> None:
    process = SupervisedProcess(threads, stopped)
    try:
        while not stopped.is_set() and (job := waiting.get()) is not None:
            events.put({"event": "scene_started", "key": job.key, "name": job.name})
            record = tune_with_retries(process, job, limits, events.put)
            if record is None:
                stopped.wait(BUSY_SECONDS)
                waiting.put(job)
            else:
                events.put({"event": "record", **asdict(record)})
    except StoppedError:
        pass
    # Any other error ends the batch. Pass it to the main thread, which can tell the user.
    except BaseException as error:
        events.put(error)
    finally:
        process.close()
