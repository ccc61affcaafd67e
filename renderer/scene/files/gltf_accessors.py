"""glTF accessors: strided, normalised or sparse arrays in buffers. All bounds are checked before access."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Int64, Num

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.gltf_buffers import GltfBuffers
from vpltune.renderer.scene.files.gltf_document import GltfDocument
from vpltune.renderer.scene.files.json_object import JsonObject, shown
from vpltune.renderer.scene.files.limits import MAX_DECODED_BYTES

# glTF 2.0 section 3.6.2.2: component types, which are OpenGL enums, and component counts.
_COMPONENT_DTYPES = {
    5120: np.dtype("i1"),
    5121: np.dtype("u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
_COMPONENT_COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass(frozen=True)
class Elements:
    """The elements of an accessor as stored. Usually a view into the buffer, not a copy."""

    stored: Num[np.ndarray, "count components"]
    normalized: bool
    """Whether integers stand for fractions in [0, 1] or [−1, 1]."""
    where: str
    """The accessor's place in the document, for messages."""

    def __len__(self) -> int:
        return len(self.stored)

    def as_floats(self, rows: Int64[np.ndarray, " n"] | None = None) -> Float32[np.ndarray, "n components"]:
        """The elements with the indices `rows`, or all, as floats (glTF 2.0 section 3.11).

        Raises:
            SceneFileError: an element is NaN or infinite.
        """
        chosen = self.stored if rows is None else self.stored[rows]
        values = chosen.astype(np.float32)
        if self.normalized and chosen.dtype.kind in "iu":
            values /= np.float32(np.iinfo(chosen.dtype).max)
            np.maximum(values, np.float32(-1.0), out=values)  # −128 and −127 both stand for −1
        if not np.isfinite(values).all():
            row = int(np.flatnonzero(~np.isfinite(values).all(axis=1))[0])
            raise SceneFileError(
                f"{self.where}: must be finite, got {values[row].tolist()} among its elements"
            )
        return values


class GltfAccessors:
    """The accessors of one document."""

    def __init__(self, document: GltfDocument) -> None:
        self._document = document
        self.buffers = GltfBuffers(document)

    def referred(self, holder: JsonObject, key: str, types: tuple[str, ...]) -> Elements:
        """The elements of the accessor to which `key` of `holder` refers. Its type must be one of `types`.

        Raises:
            SceneFileError: the index, type, component type, extent or buffer of the accessor is invalid.
        """
        accessors = self._document.list_of("accessors")
        accessor = accessors[holder.required_index(key, len(accessors), "accessors")]
        kind = accessor.string("type")
        if kind not in types:
            raise SceneFileError(
                f"{accessor.at('type')}: {key} must be {' or '.join(types)}, got {kind!r:.40}"
            )
        dtype = _component_dtype(accessor, tuple(_COMPONENT_DTYPES))
        shape = (accessor.integer("count", low=1), _COMPONENT_COUNTS[kind])
        sparse = accessor.object("sparse")
        if "bufferView" in accessor.members:
            stored = self._strided(accessor, dtype, shape)
        else:
            # The elements are zero, and a kilobyte of JSON can ask for any number of them.
            self._document.decoded.spend(math.prod(shape) * dtype.itemsize, accessor.where)
            stored = np.zeros(shape, dtype)
        if sparse is not None:
            stored = self._with_substitutes(sparse, stored)
        return Elements(stored, accessor.boolean("normalized", False), accessor.where)

    def count(self, holder: JsonObject, key: str) -> int:
        """The element count of the accessor to which `key` of `holder` refers. Its elements are not read.

        Raises:
            SceneFileError: the index or the count is out of range.
        """
        accessors = self._document.list_of("accessors")
        accessor = accessors[holder.required_index(key, len(accessors), "accessors")]
        return accessor.integer("count", low=1, high=MAX_DECODED_BYTES)

    def normalized(self, holder: JsonObject, key: str) -> bool:
        """Whether the accessor to which `key` of `holder` refers has normalised integers.

        Raises:
            SceneFileError: the index is out of range.
        """
        accessors = self._document.list_of("accessors")
        return accessors[holder.required_index(key, len(accessors), "accessors")].boolean("normalized", False)

    def _strided(
        self, holder: JsonObject, dtype: np.dtype, shape: tuple[int, int]
    ) -> Num[np.ndarray, "count components"]:
        content, stride = self.buffers.view(holder)
        offset = holder.integer("byteOffset", 0)
        element_size = shape[1] * dtype.itemsize
        stride = element_size if stride is None else stride
        if stride < element_size and shape[0] > 1:
            raise SceneFileError(
                f"{holder.where}: its bufferView's byteStride must be at least the element's "
                f"{element_size} bytes, got {stride}"
            )
        end = offset + stride * (shape[0] - 1) + element_size
        if end > len(content):
            raise SceneFileError(
                f"{holder.where}: its {shape[0]} elements end at byte {end}, beyond the bufferView's "
                f"{len(content)} bytes"
            )
        return np.ndarray(shape, dtype, content, offset, (stride, dtype.itemsize))

    def _with_substitutes(
        self, sparse: JsonObject, stored: Num[np.ndarray, "count components"]
    ) -> Num[np.ndarray, "count components"]:
        count = sparse.integer("count", low=1, high=len(stored))
        indices = sparse.required_object("indices")
        index_dtype = _component_dtype(indices, (5121, 5123, 5125))
        rows = self._strided(indices, index_dtype, (count, 1))[:, 0].astype(np.int64)
        if rows.max() >= len(stored) or (np.diff(rows) <= 0).any():
            raise SceneFileError(
                f"{indices.where}: must rise strictly and stay below the accessor's {len(stored)}"
            )
        values = self._strided(sparse.required_object("values"), stored.dtype, (count, stored.shape[1]))
        self._document.decoded.spend(stored.nbytes, sparse.where)
        replaced = stored.copy()
        replaced[rows] = values
        return replaced


def _component_dtype(holder: JsonObject, allowed: tuple[int, ...]) -> np.dtype:
    component_type = holder.integer("componentType")
    if component_type not in allowed:
        raise SceneFileError(
            f"{holder.at('componentType')}: must be one of {', '.join(map(str, allowed))}, "
            f"got {shown(component_type)}"
        )
    return _COMPONENT_DTYPES[component_type]
