"""Decodes Draco bitstreams in a process of its own. It is run by path and imports no VPLtune.

A bitstream of a hundred bytes can announce a thousand million points, and only the decoder can tell. Here it
runs out of memory or time, or crashes, alone.

A request on stdin is a line of JSON, then the bitstream. The line has `seconds` of processor time that the
answer may take, the `length` of the bitstream, and the `ids` of the wanted attributes. An answer on stdout
is a line of JSON with `error`, or with `arrays` and `ids`: type and shape of the faces and of each attribute.
The arrays follow.
"""

import json
import os
import sys

# A choice: address space of this process, half of it for the interpreter and its libraries.
MAX_ADDRESS_SPACE = 1 << 30


def limit_memory() -> None:
    """Limit the address space, where the system can."""
    try:
        import resource
    except ImportError:  # not on Windows
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    most = MAX_ADDRESS_SPACE if hard == resource.RLIM_INFINITY else min(MAX_ADDRESS_SPACE, hard)
    resource.setrlimit(resource.RLIMIT_AS, (most, hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def limit_time(seconds: int) -> None:
    """Let the process end itself after so much more processor time, where the system can."""
    try:
        import resource
    except ImportError:
        return
    used = resource.getrusage(resource.RUSAGE_SELF)
    _, hard = resource.getrlimit(resource.RLIMIT_CPU)
    resource.setrlimit(resource.RLIMIT_CPU, (int(used.ru_utime + used.ru_stime) + 1 + seconds, hard))


def answer_requests() -> None:
    """Answer requests until stdin ends."""
    # What a library prints must not get between the answers.
    answers = os.fdopen(os.dup(1), "wb")
    for output in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), output)
    limit_memory()
    import DracoPy
    import numpy as np

    for line in iter(sys.stdin.buffer.readline, b""):
        request = json.loads(line)
        content = sys.stdin.buffer.read(request["length"])
        limit_time(request["seconds"])
        arrays = []
        try:
            mesh = DracoPy.decode(content)
            by_id = {stored["unique_id"]: stored["data"] for stored in mesh.attributes}
            arrays.append(np.ascontiguousarray(getattr(mesh, "faces", ()), np.uint32).ravel())
            arrays += [np.ascontiguousarray(by_id[i]) for i in request["ids"] if i in by_id]
            answer: dict[str, object] = {
                "arrays": [(array.dtype.str, array.shape) for array in arrays],
                "ids": [i for i in request["ids"] if i in by_id],
            }
        except MemoryError:
            answer = {"error": f"it needs more than {MAX_ADDRESS_SPACE >> 20} MiB"}
        except Exception as error:
            answer = {"error": str(error)}
        answers.write(json.dumps(answer).encode() + b"\n")
        if "error" not in answer:
            for array in arrays:
                answers.write(memoryview(array.reshape(-1)).cast("B") if array.size else b"")
        answers.flush()


if __name__ == "__main__":
    answer_requests()
