"""EXT_meshopt_compression: compressed buffer views."""

import numpy as np

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.json_object import JsonObject
from vpltune.renderer.scene.files.limits import DecodedBytes
from vpltune.renderer.scene.files.meshopt_attributes import decode_attributes
from vpltune.renderer.scene.files.meshopt_filters import FILTER_STRIDES, unfiltered
from vpltune.renderer.scene.files.meshopt_indices import decode_indices, decode_triangles

# The modes of EXT_meshopt_compression.
_MODES = ("ATTRIBUTES", "TRIANGLES", "INDICES")


def decompressed_view(
    content: memoryview, view: JsonObject, compression: JsonObject, decoded: DecodedBytes
) -> memoryview:
    """The decompressed bytes of a buffer view.

    Args:
        content: the compressed stream.
        view: the buffer view.
        compression: its extension object.
        decoded: the memory limit.

    Raises:
        SceneFileError: a key is missing or out of range, the stream is broken, or memory runs out.
    """
    mode = compression.string("mode")
    if mode not in _MODES:
        raise SceneFileError(
            f"{compression.at('mode')}: must be one of {', '.join(_MODES)}, got {mode!r:.40}"
        )
    kind = compression.string("filter", "NONE")
    if kind not in FILTER_STRIDES or (mode != "ATTRIBUTES" and kind != "NONE"):
        raise SceneFileError(f"{compression.at('filter')}: is not allowed with mode {mode}, got {kind!r:.40}")
    stride = compression.integer("byteStride", low=1, high=256)
    allowed = FILTER_STRIDES[kind] if mode == "ATTRIBUTES" else (2, 4)
    if stride not in allowed:
        raise SceneFileError(
            f"{compression.at('byteStride')}: is not allowed with mode {mode} and filter {kind}, got {stride}"
        )
    count = compression.integer("count", low=1)
    if mode == "TRIANGLES" and count % 3:
        raise SceneFileError(f"{compression.at('count')}: must be a multiple of three, got {count}")
    length = view.integer("byteLength", low=1)
    if length != count * stride:
        raise SceneFileError(
            f"{view.at('byteLength')}: must be count times byteStride, {count * stride}, got {length}"
        )
    decoded.spend(length, view.where)
    # The decoders require at least one byte per triangle, index or group header, so a short stream decodes to
    # little.
    stream = bytes(content)
    if mode == "ATTRIBUTES":
        return memoryview(unfiltered(decode_attributes(stream, count, stride, view.where), kind).tobytes())
    decode = decode_triangles if mode == "TRIANGLES" else decode_indices
    indices = decode(stream, count, view.where)
    return memoryview(indices.astype(np.dtype(f"<u{stride}")).tobytes())
