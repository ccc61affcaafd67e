"""Tune one scene exactly once. Every scheduler calls this, on any machine."""

import datetime
import resource
import shutil
import socket
import time
from collections.abc import Callable
from pathlib import Path

from vpltune.renderer.errors import InputError
from vpltune.tuner.batch.claim import claimed
from vpltune.tuner.batch.job import Job
from vpltune.tuner.batch.record import Record, Records, Status

Progress = Callable[[str, float], None]


def tune_one(job: Job, attempt: int = 1, progress: Progress = lambda stage, share: None) -> Record | None:
    """Fit the scene of `job` unless it has a record, and return the record.

    Any number of processes on any machines may call this at once for the same job: the record on disk
    decides. It is written last, so the files that it names are complete. Output that a killed process left is
    replaced.

    Args:
        job: What to fit.
        attempt: Number of the attempt, from 1.
        progress: Called with the stage and the share of it that is done, in [0, 1].

    Returns:
        The record, or None if another process is working on the scene.

    Raises:
        MachineError: this machine cannot fit anything.
        Exception: the attempt failed; nothing is recorded.
    """
    records = Records(Path(job.folder))
    record = records.read(job.key)
    if record is not None:
        return record
    with claimed(job.claim) as mine:
        if not mine:
            return None
        # The previous holder of the claim may have written the record.
        record = records.read(job.key)
        if record is None:
            record = _fitted(job, attempt, progress)
            records.write(record)
        return record


def set_aside(job: Job, reason: str, attempts: int, seconds: float) -> Record | None:
    """Record that every attempt failed, and return the record.

    If the scene has a record by now, that one is returned. None if another process is working on the scene.
    """
    records = Records(Path(job.folder))
    with claimed(job.claim) as mine:
        if not mine:
            return None
        record = records.read(job.key)
        if record is None:
            shutil.rmtree(job.output, ignore_errors=True)
            record = _record(job, "failed", reason, seconds, attempts, "")
            records.write(record)
        return record


def _fitted(job: Job, attempt: int, progress: Progress) -> Record:
    # Imported here, so that a scheduler can import this module without loading JAX.
    from vpltune.tuner.scene_fit.fit_scene import fit_scene

    started = time.perf_counter()
    shutil.rmtree(job.output, ignore_errors=True)
    try:
        result = fit_scene(Path(job.scene), job.output, job.options.fit_options(job.command), progress)
    except InputError as error:
        if str(error).startswith(job.folder):
            raise  # the output folder cannot be written to; the scene is not to blame
        return _record(job, "refused", str(error), time.perf_counter() - started, attempt, "")
    document = result.document
    status: Status = "unlit" if document["status"] == "unlit" else "done"
    return _record(
        job,
        status,
        document["sentence"],
        time.perf_counter() - started,
        attempt,
        job.output_name,
        document["seconds"],
        document["status"],
    )


def _record(
    job: Job,
    status: Status,
    reason: str,
    seconds: float,
    attempts: int,
    output: str,
    stages: dict[str, float] | None = None,
    fit: str = "",
) -> Record:
    return Record(
        key=job.key,
        scene=job.scene,
        name=job.name,
        status=status,
        reason=" ".join(reason.split()),
        seconds=seconds,
        attempts=attempts,
        output=output,
        host=socket.gethostname(),
        finished=datetime.datetime.now(datetime.UTC).isoformat(timespec="milliseconds"),
        # ru_maxrss is in KiB on Linux.
        peak_memory_bytes=1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss if stages else 0,
        fit=fit,
        stages=dict(stages or {}),
    )
