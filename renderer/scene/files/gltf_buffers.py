"""glTF buffers, buffer views and URIs: the bytes of accessors and images."""

import base64
import binascii
import re
import urllib.parse
from collections import Counter

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.gltf_document import GltfDocument
from vpltune.renderer.scene.files.gltf_meshopt import decompressed_view
from vpltune.renderer.scene.files.json_object import JsonObject

# The scheme of a URI (RFC 3986 section 3.1).
_SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]*:")


class GltfBuffers:
    """The buffers of one document. Each is read once, when it is first needed."""

    def __init__(self, document: GltfDocument) -> None:
        self._document = document
        self._buffers: dict[str, memoryview] = {}
        self._decompressed_views: dict[str, memoryview] = {}
        self._compressed_bytes: Counter[int] = Counter()

    def view(self, holder: JsonObject, key: str = "bufferView") -> tuple[memoryview, int | None]:
        """The bytes of the buffer view to which `key` of `holder` refers, and its byteStride or None.

        Raises:
            SceneFileError: the reference, the view or its buffer is invalid or missing.
        """
        views = self._document.list_of("bufferViews")
        view = views[holder.required_index(key, len(views), "bufferViews")]
        # The format allows multiples of 4 up to 252 only, but other strides are unambiguous.
        stride = view.integer("byteStride", low=1, high=2**31) if "byteStride" in view.members else None
        compression = view.extension("EXT_meshopt_compression")
        if compression is not None and self._is_placeholder(view):
            return self._decompressed(view, compression), stride
        return self._slice(view), stride

    def _is_placeholder(self, view: JsonObject) -> bool:
        """Whether the view's buffer has no bytes of its own, so that the view must be decompressed."""
        buffers = self._document.list_of("buffers")
        index = view.required_index("buffer", len(buffers), "buffers")
        in_file = index == 0 and self._document.binary_chunk is not None
        return "uri" not in buffers[index].members and not in_file

    def _decompressed(self, view: JsonObject, compression: JsonObject) -> memoryview:
        if view.where not in self._decompressed_views:
            self._count_compressed(compression)
            self._decompressed_views[view.where] = decompressed_view(
                self._slice(compression), view, compression, self._document.decoded
            )
        return self._decompressed_views[view.where]

    def _count_compressed(self, compression: JsonObject) -> None:
        # Streams take much longer to decode than to name again, so no byte may be in several of them.
        index = compression.integer("buffer")
        self._compressed_bytes[index] += len(self._slice(compression))
        if self._compressed_bytes[index] > len(self._buffer(compression)):
            raise SceneFileError(
                f"{compression.where}: must not overlap other compressed views of its buffer"
            )

    def _slice(self, view: JsonObject) -> memoryview:
        start = view.integer("byteOffset", 0)
        length = view.integer("byteLength", low=1)
        buffer = self._buffer(view)
        if start + length > len(buffer):
            raise SceneFileError(
                f"{view.where}: must lie within its buffer of {len(buffer)} bytes, got {start} to "
                f"{start + length}"
            )
        return buffer[start : start + length]

    def _buffer(self, view: JsonObject) -> memoryview:
        buffers = self._document.list_of("buffers")
        index = view.required_index("buffer", len(buffers), "buffers")
        buffer = buffers[index]
        if buffer.where not in self._buffers:
            length = buffer.integer("byteLength", low=1)
            if "uri" in buffer.members:
                content = read_uri(self._document, buffer)
            elif index == 0 and self._document.binary_chunk is not None:
                content = self._document.binary_chunk
            else:
                raise SceneFileError(f"{buffer.where}: has no uri, and the file has no binary chunk for it")
            if len(content) < length:
                raise SceneFileError(
                    f"{buffer.at('byteLength')}: says {length}, but there are {len(content)} bytes"
                )
            self._buffers[buffer.where] = memoryview(content)[:length]
        return self._buffers[buffer.where]


def read_uri(document: GltfDocument, holder: JsonObject) -> bytes:
    """The bytes of a `uri` of a buffer or image: a data URI, or a file in the scene's folder.

    Raises:
        SceneFileError: the URI has another scheme, leads out of the folder or has broken base64, or the file
            cannot be read.
    """
    uri = holder.string("uri")
    where = holder.at("uri")
    if not uri.isascii() and any("\ud800" <= c <= "\udfff" for c in uri):
        raise SceneFileError(f"{where}: must be Unicode text, got the lone surrogate in {uri!r:.80}")
    if uri[:5].lower() == "data:":
        return _data_uri(uri, where)
    if _SCHEME.match(uri):
        raise SceneFileError(f"{where}: must be a data: URI or a file in the scene's folder, got {uri!r:.80}")
    path = urllib.parse.unquote(uri)
    # Some exporters do not encode a literal %.
    if path != uri and not document.folder.has(path, where) and document.folder.has(uri, where):
        path = uri
    return document.folder.read(path, where)


def _data_uri(uri: str, where: str) -> bytes:
    head, comma, body = uri.partition(",")
    if not comma:
        raise SceneFileError(f"{where}: a data: URI must have a comma, got {uri!r:.60}")
    if not head.lower().endswith(";base64"):
        return urllib.parse.unquote_to_bytes(body)
    try:
        return base64.b64decode(urllib.parse.unquote(body) if "%" in body else body, validate=True)
    except (binascii.Error, ValueError) as error:
        raise SceneFileError(f"{where}: is not base64 ({error})") from error
