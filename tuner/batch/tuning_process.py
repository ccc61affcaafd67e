"""The process that fits: takes jobs from its parent one after another, and reports how each ended.

Started as `python -m vpltune.tuner.batch.tuning_process FD`, with FD one end of a socket. A scene that
brings the process down, or that has to be stopped, takes nobody else with it.
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
"""Without a job, after which it ends: a cluster's worker stays when a batch is over, and memory is dear."""


def main(handle: int) -> None:
    """Serve until no job comes, or the parent closes the socket or dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    threading.Thread(target=_die_with_parent, daemon=True).start()
    import vpltune.tuner.scene_fit.fit_scene  # noqa: F401  before the first job, whose time is limited

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
        return {"machine_error": str(error)}
    # A defect, a full disk, no memory: the attempt failed, and the next scene may fare better.
    except Exception as error:
        traceback.print_exc()
        return {"failed": f"{type(error).__name__}: {error}"}
    return {"busy": True} if record is None else {"record": as_document(record)}


def _die_with_parent() -> None:
    # The parent holds the other end of stdin and never writes: its end is the parent's.
    while os.read(0, 4096):
        pass
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    main(int(sys.argv[1]))
