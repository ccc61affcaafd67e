"""KHR_draco_mesh_compression: the geometry of a primitive in a Draco bitstream."""

import math

import numpy as np
from jaxtyping import Int64

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.gltf_accessors import Elements, GltfAccessors
from vpltune.renderer.scene.files.json_object import JsonObject
from vpltune.renderer.scene.files.limited_decoder import LimitedDecoder
from vpltune.renderer.scene.files.limits import DRACO_BYTES_PER_SECOND, DRACO_SECONDS, DecodedBytes


def decode_draco(
    accessors: GltfAccessors,
    primitive: JsonObject,
    compression: JsonObject,
    decoded: DecodedBytes,
    decoder: LimitedDecoder,
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
    corners, by_id = _bitstream(decoder, content, wanted, (vertex_count, corner_count), compression.where)
    elements: dict[str, Elements] = {}
    for semantic, unique_id in unique_ids.items():
        if unique_id not in by_id or semantic not in attributes.members:
            raise SceneFileError(
                f"{ids.at(semantic)}: attribute {unique_id} must be in the bitstream and the primitive"
            )
        stored = by_id[unique_id].reshape(len(by_id[unique_id]), -1)
        elements[semantic] = Elements(stored, accessors.normalized(attributes, semantic), ids.at(semantic))
    return elements, corners


def _bitstream(
    decoder: LimitedDecoder, content: memoryview, ids: list[int], counts: tuple[int, int], where: str
) -> tuple[Int64[np.ndarray, " corners"], dict[int, np.ndarray]]:
    """The triangle corners in a bitstream, and those of its vertex attributes with the given ids.

    `counts` of vertices and of corners are those that it must have.
    """
    seconds = DRACO_SECONDS + len(content) // DRACO_BYTES_PER_SECOND
    answer = decoder.answer(content, seconds, ids=ids)
    if "error" in answer:
        raise SceneFileError(f"{where}: Draco cannot decode it ({answer['error']})")
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
        corners = decoder.array(faces_type, [held]).astype(np.int64)
        return corners, {
            unique_id: decoder.array(dtype, shape)
            for unique_id, (dtype, shape) in zip(answer["ids"], stored, strict=True)
        }
    except EOFError as error:
        raise SceneFileError(f"{where}: Draco cannot decode it ({decoder.end(seconds)})") from error
