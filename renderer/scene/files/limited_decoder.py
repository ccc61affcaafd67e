"""A process with limits of memory and time that decodes bitstreams: the side that asks."""

import json
import math
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any, Literal

import numpy as np

_PROGRAM = Path(__file__).with_name("decoder_process.py")


class LimitedDecoder:
    """The process that decodes the bitstreams of one kind in one scene. It starts with the first of them.

    Args:
        kind: "draco" for meshes, "ktx2" for images.
    """

    def __init__(self, kind: Literal["draco", "ktx2"]) -> None:
        self._kind = kind
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "LimitedDecoder":
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()

    def answer(self, content: bytes | memoryview, seconds: int, **request: Any) -> dict[str, Any]:
        """What the decoder answers; its arrays are then read in order with `array`, after their check.

        Args:
            content: the bitstream.
            seconds: processor time that it may take.
            request: what the kind asks for.

        Returns:
            `arrays`, the type and shape of each, with what the kind adds; or `error`, the cause.
        """
        process = self._started()
        assert process.stdin is not None
        assert process.stdout is not None
        line = json.dumps({"seconds": seconds, "length": len(content), **request})
        answer = b""
        try:
            process.stdin.write(line.encode() + b"\n")
            process.stdin.write(content)
            process.stdin.flush()
            answer = process.stdout.readline()
        except BrokenPipeError:
            pass
        return json.loads(answer) if answer else {"error": self.end(seconds)}

    def array(self, dtype: str, shape: list[int]) -> np.ndarray:
        """The next array of an answer.

        Raises:
            EOFError: the process ended before; `end` tells why.
        """
        process = self._started()
        assert process.stdout is not None
        length = math.prod(shape) * np.dtype(dtype).itemsize
        content = process.stdout.read(length)
        if len(content) < length:
            raise EOFError
        return np.frombuffer(content, dtype).reshape(shape)

    def end(self, seconds: int) -> str:
        """Why the process has ended, or ends now, as its return code tells; `seconds` as it was allowed."""
        code = self._started().wait()
        if code >= 0:
            return f"the decoder ended with exit code {code}"
        # Windows has no SIGXCPU, and no limit of time.
        if code == -getattr(signal, "SIGXCPU", 0):
            return f"it took more than {seconds} s"
        return f"the decoder was ended by {signal.Signals(-code).name}"

    def _started(self) -> subprocess.Popen[bytes]:
        if self._process is None:
            paths = os.pathsep.join(path for path in sys.path if path)
            self._process = subprocess.Popen(
                [sys.executable, "-P", str(_PROGRAM), self._kind],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                # One thread: each further one of numpy's reserves address space.
                env={**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            )
        return self._process
