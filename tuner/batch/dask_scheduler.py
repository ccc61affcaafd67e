"""The scheduler of a cluster with Dask: its workers fit, each scene in a supervised process of their own.

Dask keeps nothing that counts. A worker that dies has its scene given to another; a scheduler that dies is
waited for, and gets every scene again that has no record yet.
"""

import itertools
import time
import uuid
from collections import deque
from collections.abc import Iterator, Sequence
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
"""For a scheduler to answer, at the start and after it was lost."""
POLL_SECONDS = 0.2
CREW_SECONDS = 5.0
"""Between two looks at how many workers there are."""
MOST_AT_ONCE = 4096
"""Scenes handed to Dask at a time: enough for any cluster, and soon handed out again."""

Event = dict[str, Any]


def tune_on_dask(jobs: Sequence[Job], address: str, threads: int, limits: Limits) -> Iterator[Event]:
    """Tune `jobs`, begun about in their order, on the workers of the scheduler at `address`.

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
    """Until all is done, or the scheduler is lost: then what was in its hands is waiting again."""
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
    """How many scenes the cluster does at a time, asked for now and then."""

    def __init__(self, client: "distributed.Client") -> None:
        self._client = client
        self._asked = -CREW_SECONDS
        self._count = 0

    def changes(self) -> Iterator[Event]:
        """A `workers` event where the number has changed."""
        now = time.monotonic()
        if now - self._asked < CREW_SECONDS:
            return
        self._asked = now
        try:
            count = sum(self._client.nthreads().values())
        except (OSError, TimeoutError):
            return  # the scheduler is being lost
        if count != self._count:
            self._count = count
            yield {"event": "workers", "count": count}


def _events_of(future: "distributed.Future", job: Job, deaths: dict[str, int], limits: Limits) -> list[Event]:
    """What a task that ended has to tell; nothing where it is to be handed out again."""
    if future.status not in ("finished", "error"):
        return []  # lost with the scheduler, or cancelled by it
    record = Records(Path(job.folder)).read(job.key)
    if record is not None and record.attempts == 1:
        # All that there is to tell, without asking a worker: a thousand of them finish hundreds a second.
        return [{"event": "record", **asdict(record)}]
    try:
        return future.result(timeout=10.0)
    except MachineError:
        raise
    except distributed.KilledWorker as error:
        # The scene itself runs in a process apart; still, it may be what brings whole workers down.
        deaths[job.key] = deaths.get(job.key, 0) + 1
        reason = f"the Dask workers that had it died ({error})"
        if deaths[job.key] <= limits.retries:
            return [_failed_attempt(job, deaths[job.key], reason)]
        record = set_aside(job, reason, deaths[job.key], 0.0)
        return [] if record is None else [{"event": "record", **asdict(record)}]
    except (TimeoutError, OSError):  # its worker died as it was to hand the answer over
        return []
    except Exception as error:
        if isinstance(error, distributed.CancelledError):
            return []
        raise MachineError(f"a Dask worker cannot fit: {type(error).__name__}: {error}") from error


def tune_as_task(job: str, threads: int, limits: dict[str, Any]) -> list[Event]:
    """What a Dask worker runs: all attempts at a scene; no `record` event where another process has it."""
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
            raise MachineError(f"--scheduler: {address!r:.100} is no address ({error})") from error
        except (OSError, TimeoutError) as error:
            if time.monotonic() > deadline:
                raise MachineError(
                    f"--scheduler: no Dask scheduler answers at {address} ({error}); what is done is kept"
                ) from error
            time.sleep(1.0)
