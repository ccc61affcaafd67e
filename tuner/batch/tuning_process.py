"""The process that fits. It takes jobs from its parent, one at a time, and reports the result of each.

It is started as `python -m vpltune.tuner.batch.tuning_process FD`, where FD is one end of a socket. It is a
separate process so that a scene that crashes or has to be stopped affects no other.
"""

import contextlib
import os
import signal
import sys
import threading
import traceback
from multiprocessing.connection import Connection
from typing import Any

from vpltune.renderer.errors import MachineError
from vpltune.tuner.batch.job import Job
from vpltune.tuner.batch.messages import receive, send
from vpltune.tuner.batch.record import as_document
from vpltune.tuner.batch.tune_one import tune_one

IDLE_SECONDS = 120.0
"""The process ends after this time without a job. A choice: cluster workers outlive the batch, and an idle
process would keep its memory."""


def main(handle: int) -> None:
    """Serve jobs from file descriptor `handle` until there are none, or the parent closes it or dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C
    threading.Thread(target=_die_with_parent, daemon=True).start()
    import vpltune.tuner.scene_fit.fit_scene  # noqa: F401  now, not within the time limit of the first job

    connection = Connection(handle)
    with contextlib.suppress(EOFError, OSError):
        send(connection, {"ready": True})
        while connection.poll(IDLE_SECONDS):
            order = receive(connection)
            send(connection, _outcome(connection, Job.from_json(order["job"]), order["attempt"]))


def _outcome(connection: Connection, job: Job, attempt: int) -> dict[str, Any]:
    def progress(stage: str, share: float) -> None:
        send(connection, {"stage": stage, "share": share})

    try:
        record = tune_one(job, attempt, progress)
    except MachineError as error:
        if _ends_every_fit(job, error):
            return {"machine_error": str(error)}
        # What the driver still holds must not count against the next scene.
        return {"failed": str(error), "renew": True}
    # A bug, a full disk, or no memory left: this attempt failed, but other scenes may succeed.
    except Exception as error:
        traceback.print_exc()
        return {"failed": f"{type(error).__name__}: {error}"}
    return {"busy": True} if record is None else {"record": as_document(record)}


def _ends_every_fit(job: Job, error: MachineError) -> bool:
    """Whether `error` ends every fit on this machine. A scene too large for the GPU ends its own alone."""
    if str(error).startswith(job.folder):
        return True  # the batch folder cannot be written to
    from vpltune.renderer.gpu.gpu_context import create_context
    from vpltune.tuner.doctor.jax_platform import require_jax_platform

    try:
        create_context().release()
        require_jax_platform()
    except MachineError:
        return True
    return False


def _die_with_parent() -> None:
    # The parent holds the other end of stdin and never writes, so end of file means that the parent died.
    while os.read(0, 4096):
        pass
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    main(int(sys.argv[1]))
