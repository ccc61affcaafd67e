"""The glTF 2.0 container: .gltf and .glb files, with their version and extensions checked."""

import struct
from dataclasses import dataclass, field
from pathlib import Path

from vpltune.renderer.files.glb_container import BINARY_CHUNK, GLB_MAGIC, JSON_CHUNK
from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings
from vpltune.renderer.scene.files.json_object import JsonObject, JsonObjects, parse_json
from vpltune.renderer.scene.files.limits import DecodedBytes
from vpltune.renderer.scene.files.scene_folder import SceneFolder

# Extensions that the readers support.
READ_EXTENSIONS = frozenset(
    {
        "EXT_mesh_gpu_instancing",
        "EXT_meshopt_compression",
        "EXT_texture_webp",
        "KHR_draco_mesh_compression",
        "KHR_lights_punctual",
        "KHR_materials_emissive_strength",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_unlit",
        "KHR_mesh_quantization",
        "KHR_node_visibility",
        "KHR_texture_basisu",
        "KHR_texture_transform",
    }
)

# Extensions for gloss, layers, metadata and motion, which do not change a still image of diffuse surfaces.
IRRELEVANT_EXTENSIONS = frozenset(
    {
        "KHR_animation_pointer",
        "KHR_materials_anisotropy",
        "KHR_materials_clearcoat",
        "KHR_materials_diffuse_transmission",
        "KHR_materials_dispersion",
        "KHR_materials_ior",
        "KHR_materials_iridescence",
        "KHR_materials_sheen",
        "KHR_materials_specular",
        "KHR_materials_transmission",
        "KHR_materials_variants",
        "KHR_materials_volume",
        "KHR_xmp_json_ld",
    }
)


@dataclass(frozen=True)
class GltfDocument:
    """A parsed glTF file, and the state kept while it is read."""

    root: JsonObject
    folder: SceneFolder
    binary_chunk: memoryview | None
    """The BIN chunk of a .glb, or None."""
    warnings: Warnings
    decoded: DecodedBytes = field(default_factory=DecodedBytes)

    def list_of(self, kind: str) -> JsonObjects:
        """A top-level list such as "nodes"; empty if the file has none.

        Raises:
            SceneFileError: the value is not a list.
        """
        return self.root.objects(kind)

    def referred(self, holder: JsonObject, key: str, kind: str) -> JsonObject | None:
        """The member of the list `kind` to which `key` of `holder` refers; None if the key is absent.

        Raises:
            SceneFileError: the index is out of range.
        """
        index = holder.index(key, len(self.list_of(kind)), kind)
        return None if index is None else self.list_of(kind)[index]

    @property
    def required_extensions(self) -> list[str]:
        """The names in `extensionsRequired`."""
        return self.root.strings("extensionsRequired")


def open_gltf(path: Path, warnings: Warnings) -> GltfDocument:
    """Read and parse a .gltf or .glb file. Buffers and images are read later.

    Raises:
        SceneFileError: the file cannot be read, is not glTF 2.0, or requires an unsupported extension.
    """
    folder = SceneFolder(path)
    content = folder.read_scene_file(path)
    if not content:
        raise SceneFileError("is empty")
    # Decide by content, because a .glb named .gltf is common.
    is_binary = content.startswith(GLB_MAGIC) or path.suffix.lower() == ".glb"
    json_chunk, binary_chunk = _glb_chunks(content) if is_binary else (content, None)
    document = GltfDocument(parse_json(json_chunk), folder, binary_chunk, warnings)
    _check_version(document.root)
    _check_extensions(document)
    return document


def _glb_chunks(content: bytes) -> tuple[bytes, memoryview | None]:
    if len(content) < 20:
        raise SceneFileError(f"GLB header: must be at least 20 bytes, got {len(content)}")
    magic, version, length = struct.unpack_from("<4sII", content)
    if magic != GLB_MAGIC:
        raise SceneFileError(f"GLB header: must begin with 'glTF', got {magic!r}")
    if version != 2:
        raise SceneFileError(f"GLB header: version must be 2, got {version}")
    if length > len(content):
        raise SceneFileError(f"GLB header: says {length} bytes, but the file is cut off after {len(content)}")
    kind, json_chunk, end = _glb_chunk(content, 12, length)
    if kind != JSON_CHUNK:
        raise SceneFileError(f"GLB: the first chunk must be JSON, got type {kind:#x}")
    # Only the second chunk can be the binary buffer. Chunks of other types must be ignored.
    if end + 8 <= length:
        kind, binary_chunk, _ = _glb_chunk(content, end, length)
        if kind == BINARY_CHUNK:
            return bytes(json_chunk), binary_chunk
    return bytes(json_chunk), None


def _glb_chunk(content: bytes, start: int, file_length: int) -> tuple[int, memoryview, int]:
    length, kind = struct.unpack_from("<II", content, start)
    end = start + 8 + length
    if end > file_length:
        raise SceneFileError(
            f"GLB chunk at byte {start}: says {length} bytes, but {max(file_length - start - 8, 0)} are left"
        )
    return kind, memoryview(content)[start + 8 : end], end


def _check_version(root: JsonObject) -> None:
    asset = root.required_object("asset")
    # minVersion is what a reader must support. Without it, 2.0 readers can read any later 2.x.
    version = asset.string("minVersion", asset.string("version"))
    major, _, minor = version.partition(".")
    if major != "2" or ("minVersion" in asset.members and minor != "0"):
        raise SceneFileError(f"asset.version: only glTF 2.0 is read, got {version!r:.40}")


def _check_extensions(document: GltfDocument) -> None:
    known = READ_EXTENSIONS | IRRELEVANT_EXTENSIONS
    required = document.required_extensions
    for name in required:
        if name not in known:
            raise SceneFileError(f"extensionsRequired: {name!r:.80} is not supported")
    for name in document.root.strings("extensionsUsed"):
        if name not in known and name not in required:
            document.warnings.add(f"extension {name!r:.80} is ignored")
