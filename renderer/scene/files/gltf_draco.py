"""KHR_draco_mesh_compression: the geometry of a primitive in a Draco bitstream."""

import DracoPy
import numpy as np
from jaxtyping import Int64

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.gltf_accessors import Elements, GltfAccessors
from vpltune.renderer.scene.files.json_object import JsonObject
from vpltune.renderer.scene.files.limits import DecodedBytes


def decode_draco(
    accessors: GltfAccessors, primitive: JsonObject, compression: JsonObject, decoded: DecodedBytes
) -> tuple[dict[str, Elements], Int64[np.ndarray, " corners"]]:
    """The vertex attributes by semantic, and the triangle corners, of a compressed primitive.

    Args:
        accessors: gives counts and the bitstream.
        primitive: the primitive.
        compression: its extension object.
        decoded: the memory limit.

    Raises:
        SceneFileError: the bitstream is broken, lacks an attribute, or differs from the accessors' counts.
    """
    attributes = primitive.required_object("attributes")
    vertex_count = accessors.count(attributes, "POSITION")
    corner_count = accessors.count(primitive, "indices")
    # A bitstream can declare any count. Reserve 16 bytes each for the accessors' counts, which it must match.
    decoded.spend(16 * (vertex_count + corner_count), primitive.where)
    content, _ = accessors.buffers.view(compression)
    try:
        mesh = DracoPy.decode(bytes(content))
    except (DracoPy.FileTypeException, ValueError, MemoryError) as error:
        raise SceneFileError(f"{compression.where}: Draco cannot decode it ({error})") from error
    corners = np.asarray(getattr(mesh, "faces", ()), np.int64).ravel()
    if len(corners) != corner_count:
        raise SceneFileError(
            f"{compression.where}: holds {len(corners)} indices, but its accessor says {corner_count}"
        )
    by_id = {stored["unique_id"]: stored["data"] for stored in mesh.attributes}
    elements: dict[str, Elements] = {}
    ids = compression.required_object("attributes")
    for semantic in ids.members:
        unique_id = ids.integer(semantic)
        if unique_id not in by_id or semantic not in attributes.members:
            raise SceneFileError(
                f"{ids.at(semantic)}: attribute {unique_id} must be in the bitstream and the primitive"
            )
        stored = by_id[unique_id].reshape(len(by_id[unique_id]), -1)
        if len(stored) != vertex_count:
            raise SceneFileError(
                f"{ids.at(semantic)}: holds {len(stored)} vertices, but its accessor says {vertex_count}"
            )
        elements[semantic] = Elements(stored, accessors.normalized(attributes, semantic), ids.at(semantic))
    return elements, corners
