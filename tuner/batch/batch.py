"""A whole library: what is left to do is found on disk, handed to a scheduler, and summed up."""

import contextlib
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from vpltune.renderer.errors import InputError
from vpltune.renderer.files.atomic_file import write_text_whole
from vpltune.renderer.files.strict_json import strict_json
from vpltune.tuner.batch.batch_log import BatchLog
from vpltune.tuner.batch.claim import claimed
from vpltune.tuner.batch.job import Job, JobOptions
from vpltune.tuner.batch.job_key import SceneInputs, job_key
from vpltune.tuner.batch.record import Record, Records
from vpltune.tuner.batch.scene_files import library_scenes
from vpltune.tuner.batch.sweep import sweep
from vpltune.tuner.batch.tensorboard_log import fit_curves
from vpltune.tuner.reference.cache import remove_leftovers

Event = dict[str, Any]
Scheduler = Callable[[Sequence[Job]], Iterator[Event]]
"""Tunes jobs, begun in their order, and yields what happens; every job ends with a `record` event."""


@runtime_checkable
class Watcher(Protocol):
    """Whoever shows a batch while it runs."""

    def found(self, jobs: Sequence[Job], already_done: int) -> None: ...

    def happened(self, event: Event) -> None: ...


@dataclass(frozen=True)
class Library:
    """The scenes of a library as jobs, one for each content."""

    jobs: tuple[Job, ...]
    copies: dict[str, str]
    """Name of each scene that has the same content as another, to that other's name."""


@dataclass(frozen=True)
class BatchResult:
    """What became of every scene."""

    records: tuple[Record, ...]
    copies: dict[str, str]
    fitted: int
    """How many records this run made."""

    def count(self, status: str) -> int:
        """How many scenes ended as `status`."""
        return sum(record.status == status for record in self.records)


def run_batch(
    library: Path,
    folder: Path,
    options: JobOptions,
    scheduler: Scheduler,
    watcher: Watcher,
    *,
    retry_failed: bool = False,
    tensorboard: bool = False,
    command: str | None = None,
) -> BatchResult:
    """Tune every scene of `library` that has no record in `folder` yet.

    Raises:
        InputError: the library cannot be read or has no scene, or the folder cannot be written to.
        MachineError: this machine cannot fit anything.
    """
    folder = folder.resolve()
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: the output must be a folder, and is a file")
    scenes = library_scenes(library, leave_out=folder)
    folder.mkdir(parents=True, exist_ok=True)
    # Two runs on one folder share the scenes out; one of them keeps the listing.
    with claimed(folder / "claims" / "listing") as mine:
        found = jobs_of(scenes, folder, options, command, keep=mine)
        if mine:
            _keep_listing(folder, library, found)
    records = Records(folder)
    sweep(folder)
    if retry_failed:
        forget_failed(records, found.jobs)
    known = records.known_keys()
    waiting = longest_first([job for job in found.jobs if job.key not in known])
    watcher.found(waiting, len(found.jobs) - len(waiting))
    if waiting:
        remove_leftovers()
        with BatchLog(folder / "log.jsonl") as log, fit_curves(folder, tensorboard) as draw_curves:
            _run(waiting, scheduler, watcher, log, draw_curves)
    made = [record for job in found.jobs if (record := records.read(job.key)) is not None]
    return BatchResult(tuple(made), found.copies, len(waiting))


def jobs_of(
    scenes: dict[str, Path], folder: Path, options: JobOptions, command: str | None = None, *, keep: bool
) -> Library:
    """A job for each content among `scenes`, in their order; `keep`: whether digests are kept in `folder`."""
    inputs, jobs, copies = SceneInputs(folder), {}, {}
    # Hashing lets go of Python's lock: a library of many gigabytes is read by every core.
    with ThreadPoolExecutor(os.cpu_count()) as readers:
        digests = list(readers.map(inputs.digest, scenes.values()))
    for (name, path), (digest, size) in zip(scenes.items(), digests, strict=True):
        key = job_key(digest, options)
        if key in jobs:
            copies[name] = jobs[key].name
        else:
            jobs[key] = Job(key, str(path), name, str(folder), options, size, command)
    if keep:
        inputs.save()
    return Library(tuple(jobs.values()), copies)


def longest_first(jobs: Sequence[Job]) -> list[Job]:
    """The largest scenes first: begun last, a long one would keep one worker busy and the others idle."""
    return sorted(jobs, key=lambda job: -job.input_bytes)


def forget_failed(records: Records, jobs: Sequence[Job]) -> None:
    """Remove the records of scenes that failed, so that they are tried again."""
    for key in records.known_keys() & {job.key for job in jobs}:
        record = records.read(key)
        if record is not None and record.status == "failed":
            records.remove(key)


def _keep_listing(folder: Path, library: Path, found: Library) -> None:
    """Write which scene has which record: records of earlier contents and options lie beside these."""
    names = {job.name: job.key for job in found.jobs}
    for leftover in folder.glob(".*.json"):
        leftover.unlink()
    names |= {copy: names[name] for copy, name in found.copies.items()}
    write_text_whole(
        folder / "library.json", strict_json({"library": str(library.resolve()), "scenes": names}) + "\n"
    )


def _run(
    waiting: Sequence[Job],
    scheduler: Scheduler,
    watcher: Watcher,
    log: BatchLog,
    draw_curves: Callable[[Event], None],
) -> None:
    started = time.perf_counter()
    log.write({"event": "run_started", "scenes": len(waiting)})
    ended = "interrupted"
    try:
        with contextlib.closing(scheduler(waiting)) as events:
            for event in events:
                if event["event"] != "stage":
                    log.write(event)
                if event["event"] == "record":
                    draw_curves(event)
                watcher.happened(event)
        ended = "done"
    finally:
        log.write({"event": "run_finished", "reason": ended, "seconds": time.perf_counter() - started})
