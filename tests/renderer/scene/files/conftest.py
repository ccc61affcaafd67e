"""Small glTF files built in tests from known arrays."""

import io
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

_COMPONENT_TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)


class GltfFile:
    """A glTF document under construction. `document` is its JSON; tests may change it before `write`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.blob = bytearray()
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}],
            "accessors": [],
            "bufferViews": [],
        }

    @property
    def primitive(self) -> dict[str, Any]:
        return self.document["meshes"][0]["primitives"][0]

    @property
    def node(self) -> dict[str, Any]:
        return self.document["nodes"][0]

    def add(self, kind: str, member: dict[str, Any]) -> int:
        self.document.setdefault(kind, []).append(member)
        return len(self.document[kind]) - 1

    def view(self, content: bytes, **members: Any) -> int:
        self.blob += bytes(-len(self.blob) % 4)
        offset = len(self.blob)
        self.blob += content
        view = {"buffer": 0, "byteOffset": offset, "byteLength": len(content)}
        return self.add("bufferViews", view | members)

    def accessor(self, values: np.ndarray, **members: Any) -> int:
        """Add a tightly packed accessor with the array's component type and shape; returns its index."""
        columns = 1 if values.ndim == 1 else values.shape[1]
        kind = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}[columns]
        accessor = {
            "bufferView": self.view(values.tobytes()),
            "componentType": _COMPONENT_TYPES[values.dtype.str[1:]],
            "count": len(values),
            "type": kind,
        }
        return self.add("accessors", accessor | members)

    def add_primitive(
        self, positions: np.ndarray = TRIANGLE, indices: np.ndarray | None = None, **attributes: np.ndarray
    ) -> dict[str, Any]:
        primitive: dict[str, Any] = {"attributes": {"POSITION": self.accessor(positions)}}
        for semantic, values in attributes.items():
            primitive["attributes"][semantic] = self.accessor(values)
        if indices is not None:
            primitive["indices"] = self.accessor(indices)
        self.document["meshes"][0]["primitives"].append(primitive)
        return primitive

    def add_base_color_image(self, image: Image.Image | bytes, **info: Any) -> dict[str, Any]:
        """Give the first primitive a material with this base-colour texture; returns the texture object."""
        if isinstance(image, Image.Image):
            stream = io.BytesIO()
            image.save(stream, "PNG")
            image = stream.getvalue()
        texture: dict[str, Any] = {
            "source": self.add("images", {"bufferView": self.view(image), "mimeType": "image/png"})
        }
        info = {"index": self.add("textures", texture)} | info
        matt = {"baseColorTexture": info, "metallicFactor": 0}
        material = self.add("materials", {"pbrMetallicRoughness": matt})
        self.primitive["material"] = material
        return texture

    def write(self, name: str = "scene.gltf") -> Path:
        """Write a .gltf with a .bin beside it, or a .glb."""
        path = self.folder / name
        buffer: dict[str, Any] = {"byteLength": max(len(self.blob), 1)}
        if path.suffix == ".glb":
            path.write_bytes(glb(self.document | {"buffers": [buffer]}, bytes(self.blob)))
            return path
        buffer["uri"] = f"{path.stem}.bin"
        (self.folder / buffer["uri"]).write_bytes(bytes(self.blob) or b"\0")
        path.write_text(json.dumps({"buffers": [buffer]} | self.document))
        return path


def glb(document: dict[str, Any], blob: bytes) -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    blob += bytes(-len(blob) % 4)
    length = 12 + 8 + len(text) + 8 + len(blob)
    return (
        struct.pack("<4sII", b"glTF", 2, length)
        + struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(blob), b"BIN\0")
        + blob
    )


@pytest.fixture
def gltf(tmp_path: Path) -> GltfFile:
    """An empty document with one node and one mesh."""
    return GltfFile(tmp_path)


@pytest.fixture
def triangle(gltf: GltfFile) -> GltfFile:
    """A document that shows one triangle: (0, 0, 0), (1, 0, 0), (0, 1, 0)."""
    gltf.add_primitive()
    return gltf
