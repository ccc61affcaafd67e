"""Decodes bitstreams of one kind in a process of its own. It is run by path and imports no VPLtune.

A bitstream of a hundred bytes can announce a thousand million points, and only the decoder can tell. Here it
runs out of memory or time, or crashes, alone.

The argument is the kind. A request on stdin is a line of JSON, then the bitstream. The line has `seconds` of
processor time that the answer may take, the `length` of the bitstream, and what the kind asks for. An answer
on stdout is a line of JSON with `error`, or with `arrays`, the type and shape of each, and what the kind
adds. The arrays follow.
"""

import json
import os
import sys
from collections.abc import Callable
from typing import Any

# A choice: address space of this process, half of it for the interpreter and its libraries.
MAX_ADDRESS_SPACE = 1 << 30

# Takes a bitstream and its request; gives what the answer adds, and the arrays.
_Decode = Callable[[bytes, dict[str, Any]], tuple[dict[str, Any], list[Any]]]


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


def _draco() -> _Decode:
    """Meshes. A request has `ids` of the wanted attributes; an answer the faces, then those of `ids`."""
    import DracoPy
    import numpy as np

    def decode(content: bytes, request: dict[str, Any]) -> tuple[dict[str, Any], list[Any]]:
        mesh = DracoPy.decode(content)
        by_id = {stored["unique_id"]: stored["data"] for stored in mesh.attributes}
        found = [i for i in request["ids"] if i in by_id]
        faces = np.ascontiguousarray(getattr(mesh, "faces", ()), np.uint32).ravel()
        return {"ids": found}, [faces, *(np.ascontiguousarray(by_id[i]) for i in found)]

    return decode


def _ktx2() -> _Decode:
    """Images. A request has `channels`, first and last + 1 of RGBA; an answer these, of the largest level."""
    import numpy as np
    import opengl_basisu

    def decode(content: bytes, request: dict[str, Any]) -> tuple[dict[str, Any], list[Any]]:
        texels = opengl_basisu.open(content).transcode("rgba8").data
        return {}, [np.ascontiguousarray(texels[..., slice(*request["channels"])])]

    return decode


def answer_requests(decode: _Decode, answers: Any) -> None:
    """Answer requests until stdin ends."""
    for line in iter(sys.stdin.buffer.readline, b""):
        request = json.loads(line)
        content = sys.stdin.buffer.read(request["length"])
        limit_time(request["seconds"])
        arrays: list[Any] = []
        try:
            answer, arrays = decode(content, request)
            answer["arrays"] = [(array.dtype.str, array.shape) for array in arrays]
        except MemoryError:
            answer = {"error": f"it needs more than {MAX_ADDRESS_SPACE >> 20} MiB"}
        except Exception as error:
            answer = {"error": str(error)}
        answers.write(json.dumps(answer).encode() + b"\n")
        for array in arrays:
            answers.write(memoryview(array.reshape(-1)).cast("B") if array.size else b"")
        answers.flush()


if __name__ == "__main__":
    # What a library prints must not get between the answers.
    answers = os.fdopen(os.dup(1), "wb")
    for output in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), output)
    limit_memory()
    answer_requests({"draco": _draco, "ktx2": _ktx2}[sys.argv[1]](), answers)
