"""KHR_draco_mesh_compression: the geometry of a primitive in a Draco bitstream."""

import json
import math
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int64

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.gltf_accessors import Elements, GltfAccessors
from vpltune.renderer.scene.files.json_object import JsonObject
from vpltune.renderer.scene.files.limits import DRACO_BYTES_PER_SECOND, DRACO_SECONDS, DecodedBytes

_PROGRAM = Path(__file__).with_name("draco_process.py")


class DracoDecoder:
    """The process that decodes the Draco bitstreams of one scene. It starts with the first of them."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "DracoDecoder":
        return self

    def __exit__(self, *_: object) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()

    def decode(
        self, content: memoryview, ids: list[int], counts: tuple[int, int], where: str
    ) -> tuple[Int64[np.ndarray, " corners"], dict[int, np.ndarray]]:
        """The triangle corners in a bitstream, and those of its vertex attributes with the given ids.

        Args:
            content: the bitstream.
            ids: of the wanted attributes; one that the bitstream lacks is left out.
            counts: of vertices and of corners, which it must have.
            where: the place in the file, for messages.

        Raises:
            SceneFileError: the bitstream is broken, differs from the counts, or takes too much to decode.
        """
        seconds = DRACO_SECONDS + len(content) // DRACO_BYTES_PER_SECOND
        answer = self._answer({"seconds": seconds, "length": len(content), "ids": ids}, content)
        if "arrays" not in answer:
            cause = answer["error"] if "error" in answer else self._end(seconds)
            raise SceneFileError(f"{where}: Draco cannot decode it ({cause})")
        vertex_count, corner_count = counts
        (faces_type, (held,)), *stored = answer["arrays"]
        if held != corner_count:
            raise SceneFileError(f"{where}: holds {held} indices, but its accessor says {corner_count}")
        for _, shape in stored:
            # No attribute of glTF has more than four components.
            if shape[0] != vertex_count or math.prod(shape) > 4 * vertex_count:
                raise SceneFileError(
                    f"{where}: holds {shape[0]} vertices of {math.prod(shape) // max(shape[0], 1)} "
                    f"components, but its accessor says {vertex_count}, and at most 4 are allowed"
                )
        try:
            corners = self._array(faces_type, [held]).astype(np.int64)
            return corners, {
                unique_id: self._array(dtype, shape)
                for unique_id, (dtype, shape) in zip(answer["ids"], stored, strict=True)
            }
        except EOFError as error:
            raise SceneFileError(f"{where}: Draco cannot decode it ({self._end(seconds)})") from error

    def _answer(self, request: dict[str, Any], content: memoryview) -> dict[str, Any]:
        """The line that answers a request; empty if the process has ended."""
        process = self._started()
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            process.stdin.write(json.dumps(request).encode() + b"\n")
            process.stdin.write(content)
            process.stdin.flush()
        except BrokenPipeError:
            return {}
        return json.loads(process.stdout.readline() or b"{}")

    def _array(self, dtype: str, shape: list[int]) -> np.ndarray:
        process = self._started()
        assert process.stdout is not None
        length = math.prod(shape) * np.dtype(dtype).itemsize
        content = process.stdout.read(length)
        if len(content) < length:
            raise EOFError
        return np.frombuffer(content, dtype).reshape(shape)

    def _end(self, seconds: int) -> str:
        """Why the process has ended, or ends now, as its return code tells."""
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
                [sys.executable, "-P", str(_PROGRAM)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                # One thread: each further one of numpy's reserves address space.
                env={**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
            )
        return self._process


def decode_draco(
    accessors: GltfAccessors,
    primitive: JsonObject,
    compression: JsonObject,
    decoded: DecodedBytes,
    decoder: DracoDecoder,
) -> tuple[dict[str, Elements], Int64[np.ndarray, " corners"]]:
    """The vertex attributes by semantic, and the triangle corners, of a compressed primitive.

    Args:
        accessors: gives counts and the bitstream.
        primitive: the primitive.
        compression: its extension object.
        decoded: the memory limit.
        decoder: decodes the bitstream.

    Raises:
        SceneFileError: the bitstream is broken, lacks an attribute, or differs from the accessors' counts.
    """
    attributes = primitive.required_object("attributes")
    vertex_count = accessors.count(attributes, "POSITION")
    corner_count = accessors.count(primitive, "indices")
    # A bitstream can declare any count. Reserve 16 bytes each for the accessors' counts, which it must match.
    decoded.spend(16 * (vertex_count + corner_count), primitive.where)
    content, _ = accessors.buffers.view(compression)
    ids = compression.required_object("attributes")
    unique_ids = {semantic: ids.integer(semantic) for semantic in ids.members}
    wanted = sorted(set(unique_ids.values()))
    corners, by_id = decoder.decode(content, wanted, (vertex_count, corner_count), compression.where)
    elements: dict[str, Elements] = {}
    for semantic, unique_id in unique_ids.items():
        if unique_id not in by_id or semantic not in attributes.members:
            raise SceneFileError(
                f"{ids.at(semantic)}: attribute {unique_id} must be in the bitstream and the primitive"
            )
        stored = by_id[unique_id].reshape(len(by_id[unique_id]), -1)
        elements[semantic] = Elements(stored, accessors.normalized(attributes, semantic), ids.at(semantic))
    return elements, corners
