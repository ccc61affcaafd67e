"""Run a batch: find the scenes without a record, hand them to a scheduler, and sum up the results."""

import contextlib
import os
import time
from collections.abc import Callable, Generator, Sequence
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
Scheduler = Callable[[Sequence[Job]], Generator[Event, None, None]]
"""Starts the jobs in the given order and yields events. Every job ends with a `record` event."""


@runtime_checkable
class Watcher(Protocol):
    """Displays a batch while it runs."""

    def found(self, jobs: Sequence[Job], already_done: int) -> None:
        """Called once before the batch starts: the jobs to run, and how many scenes have a record already."""

    def happened(self, event: Event) -> None:
        """Called with each event of the scheduler."""


@dataclass(frozen=True)
class Library:
    """The scenes of a library as jobs. Scenes with identical content share one job."""

    jobs: tuple[Job, ...]
    copies: dict[str, str]
    """Maps the name of each duplicate scene to the name of the scene that it duplicates."""


@dataclass(frozen=True)
class BatchResult:
    """The results of a batch."""

    records: tuple[Record, ...]
    copies: dict[str, str]
    """Duplicate scenes, see `Library.copies`."""
    fitted: int
    """Number of scenes that this run had to tune."""

    def count(self, status: str) -> int:
        """Number of records with this status."""
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

    Args:
        library: A folder, or a text file that lists scenes.
        folder: Output folder; created if needed.
        options: Options of every fit.
        scheduler: Runs the jobs, see `Scheduler`.
        watcher: Displays the progress.
        retry_failed: Whether to try failed scenes again.
        tensorboard: Whether to write TensorBoard logs.
        command: The command line, for the record.

    Raises:
        InputError: the library cannot be read or has no scene, or the folder cannot be written to.
        MachineError: this machine cannot fit anything.
    """
    folder = folder.resolve()
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: the output must be a folder, and is a file")
    scenes = library_scenes(library, leave_out=folder)
    folder.mkdir(parents=True, exist_ok=True)
    # Two runs on one folder share the scenes. Only one of them writes the listing.
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
    """One job for each distinct content among `scenes`, in their order.

    `keep` says whether to save the digests of the files in `folder`.
    """
    inputs, jobs, copies = SceneInputs(folder), {}, {}
    # Hashing releases the GIL, so threads hash a large library on every core.
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
    """Jobs by descending input size. A long scene started last would leave all other workers idle."""
    return sorted(jobs, key=lambda job: -job.input_bytes)


def forget_failed(records: Records, jobs: Sequence[Job]) -> None:
    """Remove the records of failed scenes among `jobs`, so that these are tried again."""
    for key in records.known_keys() & {job.key for job in jobs}:
        record = records.read(key)
        if record is not None and record.status == "failed":
            records.remove(key)


def _keep_listing(folder: Path, library: Path, found: Library) -> None:
    """Write which record belongs to which scene: the folder keeps records of older contents and options."""
    names = {job.name: job.key for job in found.jobs}
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
