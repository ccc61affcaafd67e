"""One scene, once: the function that every scheduler calls, on whatever machine."""

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
    """Fit the scene of `job` unless that is done, and return its record; None while another process is at it.

    It may be called any number of times, at once and anywhere: the record on disk decides, and it is
    written last, so that what it says is there is there. What a killed process left is made anew.

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
        # Whoever held the claim until now may have finished.
        record = records.read(job.key)
        if record is None:
            record = _fitted(job, attempt, progress)
            records.write(record)
        return record


def set_aside(job: Job, reason: str, attempts: int, seconds: float) -> Record | None:
    """Record that every attempt failed; the record of another process stands, and None if one is at work."""
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
    # Here, so that a scheduler can name this function without loading JAX.
    from vpltune.tuner.scene_fit.fit_scene import fit_scene

    started = time.perf_counter()
    shutil.rmtree(job.output, ignore_errors=True)
    try:
        result = fit_scene(Path(job.scene), job.output, job.options.fit_options(job.command), progress)
    except InputError as error:
        if str(error).startswith(job.folder):
            raise  # the output cannot be written, which is no fault of the scene's
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
        # Linux counts in KiB.
        peak_memory_bytes=1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss if stages else 0,
        fit=fit,
        stages=dict(stages or {}),
    )
