"""Binary glTF 2.0, as little of it as the shipped scenes need; the same bytes out every time."""

import json
import struct
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np

FLOAT, UNSIGNED_SHORT = 5126, 5123
ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
# Positions and normals are rounded here, so that the last bit of a machine's sine does not reach the file.
DECIMALS = 6


@dataclass
class Shape:
    """Triangles with one normal, texture coordinate and colour per vertex."""

    positions: np.ndarray
    normals: np.ndarray
    triangles: np.ndarray
    uv: np.ndarray | None = None
    colors: np.ndarray | None = None


def joined(shapes: list[Shape]) -> Shape:
    """Several shapes as one; all of them with texture coordinates, or none."""
    starts = np.cumsum([0] + [len(shape.positions) for shape in shapes[:-1]])
    return Shape(
        np.concatenate([shape.positions for shape in shapes]),
        np.concatenate([shape.normals for shape in shapes]),
        np.concatenate([shape.triangles + start for shape, start in zip(shapes, starts, strict=True)]),
        None if shapes[0].uv is None else np.concatenate([shape.uv for shape in shapes]),
    )


def quad(corners: list[tuple[float, float, float]], facing: tuple[float, float, float]) -> Shape:
    """Two triangles over four corners in order round the rim, wound so that they face the point `facing`."""
    points = np.array(corners, np.float64)
    normal = np.cross(points[1] - points[0], points[2] - points[0])
    if normal @ (np.array(facing) - points.mean(axis=0)) < 0.0:
        points, normal = points[::-1], -normal
    return Shape(
        points,
        np.tile(normal / np.linalg.norm(normal), (4, 1)),
        np.array([[0, 1, 2], [0, 2, 3]]),
        np.array([[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]]),
    )


def box(
    low: tuple[float, float, float], high: tuple[float, float, float], *, inward: bool = False
) -> list[Shape]:
    """The six faces of a box: −x, +x, −y, +y, −z, +z; facing out, or in for a room."""
    bounds = np.array([low, high], np.float64)
    center = bounds.mean(axis=0)
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in range(2):
            corners = []
            for u_side, v_side in ((0, 0), (1, 0), (1, 1), (0, 1)):
                corner = np.empty(3)
                corner[axis], corner[u], corner[v] = bounds[side, axis], bounds[u_side, u], bounds[v_side, v]
                corners.append(tuple(corner))
            outside = 2.0 * np.mean(corners, axis=0) - center
            faces.append(quad(corners, tuple(center) if inward else tuple(outside)))
    return faces


def cylinder(radius: float, low: float, high: float, sides: int) -> Shape:
    """An upright closed cylinder about the y axis: smooth round its side, flat at its ends."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angle), np.zeros(sides), np.sin(angle)], axis=1)
    shift = np.array([0.0, 1.0, 0.0])
    positions = np.concatenate([radius * ring + y * shift for y in (low, high, low, high)])
    normals = np.concatenate([ring, ring, np.tile(-shift, (sides, 1)), np.tile(shift, (sides, 1))])
    here, there = np.arange(sides), (np.arange(sides) + 1) % sides
    side = np.concatenate(
        [
            np.stack([here, here + sides, there], axis=1),
            np.stack([there, here + sides, there + sides], axis=1),
        ]
    )
    fan = np.stack([np.zeros(sides - 2, np.int64), np.arange(1, sides - 1), np.arange(2, sides)], axis=1)
    return Shape(positions, normals, np.concatenate([side, fan + 2 * sides, fan[:, ::-1] + 3 * sides]))


def sphere(radius: float, rings: int, segments: int) -> Shape:
    """A closed sphere about the origin, from latitude rings and longitude segments."""
    polar = np.pi * np.arange(1, rings) / rings
    azimuth = 2.0 * np.pi * np.arange(segments) / segments
    middle = np.stack(
        [
            np.outer(np.sin(polar), np.cos(azimuth)),
            np.outer(np.cos(polar), np.ones(segments)),
            np.outer(np.sin(polar), np.sin(azimuth)),
        ],
        axis=2,
    ).reshape(-1, 3)
    normals = np.concatenate([[[0.0, 1.0, 0.0]], middle, [[0.0, -1.0, 0.0]]])
    here, there = np.arange(segments), (np.arange(segments) + 1) % segments
    triangles = [np.stack([np.zeros_like(here), 1 + there, 1 + here], axis=1)]
    for ring in range(rings - 2):
        upper, lower = 1 + ring * segments, 1 + (ring + 1) * segments
        triangles.append(np.stack([upper + here, upper + there, lower + there], axis=1))
        triangles.append(np.stack([upper + here, lower + there, lower + here], axis=1))
    last = 1 + (rings - 2) * segments
    triangles.append(np.stack([np.full_like(here, len(normals) - 1), last + here, last + there], axis=1))
    return Shape(radius * normals, normals, np.concatenate(triangles))


def png(texels_srgb: np.ndarray) -> bytes:
    """An 8-bit RGB PNG whose deflate stream is one stored block, the same whatever the version of zlib."""
    height, width, _ = texels_srgb.shape
    rows = b"".join(b"\x00" + row.tobytes() for row in texels_srgb.astype(np.uint8))
    stored = b"\x78\x01\x01" + struct.pack("<HH", len(rows), len(rows) ^ 0xFFFF) + rows
    stored += struct.pack(">I", zlib.adler32(rows))

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", stored) + chunk(b"IEND", b"")


@dataclass
class GlbWriter:
    """Collects one scene; `bytes()` is the file."""

    copyright: str
    document: dict[str, Any] = field(default_factory=dict)
    binary: bytearray = field(default_factory=bytearray)

    def _append(self, key: str, entry: dict[str, Any]) -> int:
        self.document.setdefault(key, []).append(entry)
        return len(self.document[key]) - 1

    def _extension(self, name: str) -> None:
        used = self.document.setdefault("extensionsUsed", [])
        if name not in used:
            used.append(name)

    def _buffer_view(self, data: bytes, **properties: int) -> int:
        self.binary.extend(b"\x00" * (-len(self.binary) % 4))
        offset = len(self.binary)
        self.binary.extend(data)
        return self._append(
            "bufferViews", {"buffer": 0, "byteOffset": offset, "byteLength": len(data), **properties}
        )

    def _accessor(self, values: np.ndarray) -> int:
        kind = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}[1 if values.ndim == 1 else values.shape[1]]
        if kind == "SCALAR":
            data, component, target = values.astype("<u2"), UNSIGNED_SHORT, ELEMENT_ARRAY_BUFFER
        else:
            data, component, target = np.round(values, DECIMALS).astype("<f4") + 0.0, FLOAT, ARRAY_BUFFER
        entry = {
            "bufferView": self._buffer_view(data.tobytes(), target=target),
            "componentType": component,
            "count": len(values),
            "type": kind,
        }
        if kind == "VEC3":
            entry["min"], entry["max"] = data.min(axis=0).tolist(), data.max(axis=0).tolist()
        return self._append("accessors", entry)

    def texture(self, name: str, texels_srgb: np.ndarray) -> int:
        """An embedded PNG with a repeating, bilinear sampler."""
        view = self._buffer_view(png(texels_srgb))
        image = self._append("images", {"name": name, "mimeType": "image/png", "bufferView": view})
        sampler = self._append(
            "samplers", {"magFilter": 9729, "minFilter": 9729, "wrapS": 10497, "wrapT": 10497}
        )
        return self._append("textures", {"source": image, "sampler": sampler})

    def material(
        self,
        name: str,
        base_color: tuple[float, float, float],
        texture: int | None = None,
        uv_scale: tuple[float, float] | None = None,
        uv_offset: tuple[float, float] = (0.0, 0.0),
    ) -> int:
        """A matt material; `uv_scale` and `uv_offset` go into KHR_texture_transform."""
        surface: dict[str, Any] = {
            "baseColorFactor": [round(float(channel), 4) for channel in base_color] + [1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": 1.0,
        }
        if texture is not None:
            surface["baseColorTexture"] = {"index": texture}
            if uv_scale is not None:
                self._extension("KHR_texture_transform")
                transform = {"offset": list(uv_offset), "scale": list(uv_scale)}
                surface["baseColorTexture"]["extensions"] = {"KHR_texture_transform": transform}
        return self._append("materials", {"name": name, "pbrMetallicRoughness": surface, "doubleSided": True})

    def mesh(self, name: str, shape: Shape, material: int) -> int:
        """One primitive; texture coordinates only where the material has a texture."""
        attributes = {"POSITION": self._accessor(shape.positions), "NORMAL": self._accessor(shape.normals)}
        textured = "baseColorTexture" in self.document["materials"][material]["pbrMetallicRoughness"]
        if textured and shape.uv is not None:
            attributes["TEXCOORD_0"] = self._accessor(shape.uv)
        if shape.colors is not None:
            attributes["COLOR_0"] = self._accessor(shape.colors)
        indices = self._accessor(shape.triangles.ravel())
        primitive = {"attributes": attributes, "indices": indices, "material": material}
        return self._append("meshes", {"name": name, "primitives": [primitive]})

    def node(self, name: str, **properties: Any) -> int:
        """A node; properties as glTF spells them (mesh, translation, matrix, children …)."""
        return self._append("nodes", {"name": name, **properties})

    def camera(self, eye: tuple[float, ...], target: tuple[float, ...], yfov: float, size: float) -> int:
        """A perspective camera; `size`, a length of the scene, sets its near and far planes."""
        lens = {
            "yfov": yfov,
            "aspectRatio": 1.0,
            "znear": round(0.001 * size, 9),
            "zfar": round(100.0 * size, 9),
        }
        camera = self._append("cameras", {"name": "camera", "type": "perspective", "perspective": lens})
        return self.node("camera", camera=camera, matrix=_look_at(eye, target))

    def light(self, light: dict[str, Any], position: tuple[float, ...], target: tuple[float, ...]) -> int:
        """A KHR_lights_punctual light that shines from `position` towards `target`."""
        self._extension("KHR_lights_punctual")
        extension = self.document.setdefault("extensions", {}).setdefault(
            "KHR_lights_punctual", {"lights": []}
        )
        extension["lights"].append(light)
        reference = {"KHR_lights_punctual": {"light": len(extension["lights"]) - 1}}
        return self.node(light["name"], matrix=_look_at(position, target), extensions=reference)

    def bytes(self, roots: list[int]) -> bytes:
        """The GLB file, with `roots` as the nodes of its one scene."""
        asset = {
            "version": "2.0",
            "generator": "VPLtune configs/scenes/make_scenes.py",
            "copyright": self.copyright,
        }
        document = {
            "asset": asset,
            "scene": 0,
            "scenes": [{"nodes": roots}],
            **self.document,
            "buffers": [{"byteLength": len(self.binary)}],
        }
        text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
        text += b" " * (-len(text) % 4)
        binary = bytes(self.binary) + b"\x00" * (-len(self.binary) % 4)
        chunks = (
            struct.pack("<II", len(text), 0x4E4F534A)
            + text
            + struct.pack("<II", len(binary), 0x004E4942)
            + binary
        )
        return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def _look_at(eye: tuple[float, ...], target: tuple[float, ...]) -> list[float]:
    """Node matrix, column by column: −z towards `target`, +y up (or +z for a vertical view)."""
    backward = np.array(eye) - np.array(target)
    backward /= np.linalg.norm(backward)
    up = np.array([0.0, 1.0, 0.0]) if abs(backward[1]) < 0.999 else np.array([0.0, 0.0, 1.0])
    right = np.cross(up, backward)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = (
        right,
        np.cross(backward, right),
        backward,
        eye,
    )
    return [round(float(value), 9) + 0.0 for value in matrix.T.ravel()]
