"""Scheduler for a Dask cluster. Each Dask worker fits scenes in a supervised process of its own.

All results are on disk, none in Dask. If a worker dies, another worker gets its scene. If the Dask scheduler
dies, the batch waits for it to return and submits every scene without a record again.
"""

import itertools
import time
import uuid
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import distributed

from vpltune.renderer.errors import MachineError
from vpltune.tuner.batch.attempts import tune_in_own_process
from vpltune.tuner.batch.job import Job
from vpltune.tuner.batch.record import Records
from vpltune.tuner.batch.supervised_process import Limits
from vpltune.tuner.batch.tune_one import set_aside

CONNECT_SECONDS = 120.0
"""Time for the Dask scheduler to answer, at the start and after a lost connection. A choice."""
POLL_SECONDS = 0.2
"""Interval between two checks of the submitted tasks, and pause before a scene that another run has claimed
is tried again. A choice."""
CREW_SECONDS = 5.0
"""Interval between two queries of the number of workers. A choice."""
MOST_AT_ONCE = 4096
"""Scenes submitted to Dask at a time. A choice: enough for any cluster, and quickly submitted again."""

Event = dict[str, Any]


def tune_on_dask(
    jobs: Sequence[Job], address: str, threads: int, limits: Limits
) -> Generator[Event, None, None]:
    """Tune `jobs`, roughly in the given order, on the workers of the Dask scheduler at `address`.

    Yields events; every job ends with a `record` event.

    Raises:
        MachineError: no scheduler answers, or a worker cannot fit anything.
    """
    waiting = deque(enumerate(jobs))
    deaths: dict[str, int] = {}
    while waiting:
        client = _connected(address)
        try:
            yield from _tune_with(client, waiting, deaths, threads, limits)
        finally:
            client.close(timeout=5.0)


def _tune_with(
    client: "distributed.Client",
    waiting: "deque[tuple[int, Job]]",
    deaths: dict[str, int],
    threads: int,
    limits: Limits,
) -> Iterator[Event]:
    """Tune until all jobs are done or the connection is lost. Unfinished jobs then go back into `waiting`."""
    flying: dict[distributed.Future, tuple[int, Job]] = {}
    run, serial, crew = uuid.uuid4().hex[:8], itertools.count(), _Crew(client)
    try:
        while waiting or flying:
            while waiting and len(flying) < MOST_AT_ONCE:
                place, job = waiting.popleft()
                future = client.submit(
                    tune_as_task,
                    job.to_json(),
                    threads,
                    asdict(limits),
                    key=f"tune-{run}-{next(serial)}",
                    pure=False,
                    priority=-place,
                )
                flying[future] = (place, job)
                yield {"event": "scene_started", "key": job.key, "name": job.name}
            time.sleep(POLL_SECONDS)
            if client.status != "running":
                return
            yield from crew.changes()
            for future in [future for future in flying if future.status != "pending"]:
                place, job = flying.pop(future)
                events = _events_of(future, job, deaths, limits)
                if not any(event["event"] == "record" for event in events):
                    waiting.append((place, job))
                yield from events
    finally:
        waiting.extend(flying.values())
        for future in flying:
            future.release()


class _Crew:
    """The number of scenes that the cluster can fit at a time, queried every `CREW_SECONDS`."""

    def __init__(self, client: "distributed.Client") -> None:
        self._client = client
        self._asked = -CREW_SECONDS
        self._count = 0

    def changes(self) -> Iterator[Event]:
        """Yields a `workers` event if the number has changed."""
        now = time.monotonic()
        if now - self._asked < CREW_SECONDS:
            return
        self._asked = now
        try:
            threads: Any = self._client.nthreads()  # a dict: the client is a synchronous one
            count = sum(threads.values())
        except (OSError, TimeoutError):
            return  # the connection is about to be lost
        if count != self._count:
            self._count = count
            yield {"event": "workers", "count": count}


def _events_of(future: "distributed.Future", job: Job, deaths: dict[str, int], limits: Limits) -> list[Event]:
    """The events of a task that ended, without a `record` event if the job has to be submitted again."""
    if future.status not in ("finished", "error"):
        return []  # the connection was lost, or the scheduler cancelled the task
    record = Records(Path(job.folder)).read(job.key)
    if record is not None and record.attempts == 1:
        # There was no failed attempt, so the record on disk says everything. Reading it avoids a request to
        # the worker: a thousand workers finish hundreds of scenes a second.
        return [{"event": "record", **asdict(record)}]
    try:
        return future.result(timeout=10.0)
    except MachineError:
        raise
    except distributed.KilledWorker as error:
        # The scene runs in a separate process but may still be what kills the workers.
        deaths[job.key] = deaths.get(job.key, 0) + 1
        reason = f"the Dask workers that ran it died ({error})"
        if deaths[job.key] <= limits.retries:
            return [_failed_attempt(job, deaths[job.key], reason)]
        record = set_aside(job, reason, deaths[job.key], 0.0)
        return [] if record is None else [{"event": "record", **asdict(record)}]
    except (TimeoutError, OSError):  # the worker died before it could send the result
        return []
    except Exception as error:
        if isinstance(error, distributed.CancelledError):
            return []
        raise MachineError(f"a Dask worker failed: {type(error).__name__}: {error}") from error


def tune_as_task(job: str, threads: int, limits: dict[str, Any]) -> list[Event]:
    """The task of a Dask worker: all attempts at one scene.

    Args:
        job: The job as JSON, see `Job.to_json`.
        threads: Threads for each library of the fit.
        limits: The fields of a `Limits`.

    Returns:
        The events, without a `record` event if another process is working on the scene.
    """
    events: list[Event] = []
    record = tune_in_own_process(
        Job.from_json(job),
        Limits(**limits),
        threads,
        lambda event: None if event["event"] == "stage" else events.append(event),
    )
    if record is None:
        time.sleep(POLL_SECONDS)
        return events
    return [*events, {"event": "record", **asdict(record)}]


def _failed_attempt(job: Job, number: int, reason: str) -> Event:
    event = {"event": "attempt_failed", "key": job.key, "name": job.name, "attempt": number}
    return {**event, "seconds": 0.0, "reason": reason}


def _connected(address: str) -> "distributed.Client":
    deadline = time.monotonic() + CONNECT_SECONDS
    while True:
        try:
            return distributed.Client(address, timeout=5.0, set_as_default=False, name="vpltune-batch")
        except ValueError as error:
            raise MachineError(f"--scheduler: must be an address, got {address!r:.100} ({error})") from error
        except (OSError, TimeoutError) as error:
            if time.monotonic() > deadline:
                raise MachineError(
                    f"--scheduler: no Dask scheduler answers at {address} ({error}); finished scenes are kept"
                ) from error
            time.sleep(1.0)
