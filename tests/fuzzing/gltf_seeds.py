"""Small valid glTF documents, each with a choice of the features that the reader knows."""

import io
import random
from typing import Any

import DracoPy
import numpy as np
from PIL import Image

# OpenGL's numbers of component types, as glTF uses them.
_COMPONENT_TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
SHARE_DRACO = 0.04
"""A choice: the reader starts a process for Draco, which takes as long as about fifty other cases."""


class GltfSeed:
    """A document of one mesh on a few nodes; `blob` is its only buffer, whose `uri` the container adds."""

    def __init__(self, rng: random.Random) -> None:
        self.rng = rng
        self.blob = bytearray()
        self.document: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0, 1]}],
        }
        self.document["nodes"] = [
            {"mesh": 0, "name": "floor"},
            {"translation": [0, 1, 0], "children": [2]},
            {},
        ]
        side = rng.choice((2, 2, 3, 5))
        grid = np.stack(np.meshgrid(*[np.linspace(0, 1, side, dtype=np.float32)] * 2), axis=-1).reshape(-1, 2)
        self.uv = grid
        self.positions = np.insert(grid, 1, 0.1 * grid[:, 0] ** 2, axis=1).astype(np.float32)
        cells = np.array([row * side + column for row in range(side - 1) for column in range(side - 1)])
        self.triangles = np.concatenate(
            [cells[:, None] + [0, side, 1], cells[:, None] + [1, side, side + 1]]
        ).astype(np.uint16)
        self.primitive: dict[str, Any] = {"attributes": {}, "indices": self.accessor(self.triangles.ravel())}
        self.primitive["attributes"]["POSITION"] = self.accessor(self.positions)
        self.document["meshes"] = [{"primitives": [self.primitive], "name": "mesh"}]
        for feature in rng.sample(_FEATURES, rng.randrange(6)):
            feature(self)
        if rng.random() < SHARE_DRACO:
            _draco(self)
        self.document["buffers"] = [{"byteLength": len(self.blob)}]

    def add(self, kind: str, member: dict[str, Any]) -> int:
        """Add a member to a list of the document; its index."""
        self.document.setdefault(kind, []).append(member)
        return len(self.document[kind]) - 1

    def extension(self, holder: dict[str, Any], name: str, content: dict[str, Any]) -> None:
        """Give `holder` an extension."""
        holder.setdefault("extensions", {})[name] = content
        used = self.document.setdefault("extensionsUsed", [])
        used += [] if name in used else [name]

    def view(self, content: bytes, **members: Any) -> int:
        """Add a buffer view of `content`; its index."""
        self.blob += bytes(-len(self.blob) % 4)
        view = {"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(content)}
        self.blob += content
        return self.add("bufferViews", view | members)

    def accessor(self, values: np.ndarray, **members: Any) -> int:
        """Add an accessor of the array's type and shape; its index."""
        accessor = {
            "bufferView": self.view(values.tobytes()),
            "byteOffset": 0,
            "componentType": _COMPONENT_TYPES[values.dtype.str[1:]],
            "count": len(values),
            "type": _TYPES[values[0].size],
        }
        return self.add("accessors", accessor | members)


def _attributes(seed: GltfSeed) -> None:
    up = np.tile(np.array([0, 1, 0], np.float32), (len(seed.positions), 1))
    seed.primitive["attributes"]["NORMAL"] = seed.accessor(up)
    colors = np.full((len(up), 4), 200, np.uint8)
    seed.primitive["attributes"]["COLOR_0"] = seed.accessor(colors, normalized=True)


def _texture(seed: GltfSeed) -> None:
    stream = io.BytesIO()
    kind = seed.rng.choice(("PNG", "JPEG", "WEBP"))
    Image.new(seed.rng.choice(("RGB", "L")), (4, 4), 128).save(stream, kind)
    image = {"bufferView": seed.view(stream.getvalue()), "mimeType": f"image/{kind.lower()}"}
    sampler = seed.add("samplers", {"wrapS": 33071, "wrapT": 10497, "magFilter": 9728})
    texture = {"source": seed.add("images", image), "sampler": sampler}
    info: dict[str, Any] = {"index": seed.add("textures", texture), "texCoord": 0}
    move = {"offset": [0.1, 0.2], "scale": [2.0, 1.0], "rotation": 0.3}
    seed.extension(info, "KHR_texture_transform", move)
    material = {"pbrMetallicRoughness": {"baseColorTexture": info, "baseColorFactor": [1, 0.5, 0.5, 1]}}
    material |= {"emissiveFactor": [1, 0.5, 0], "emissiveTexture": dict(info), "doubleSided": False}
    seed.primitive["material"] = seed.add("materials", material)
    seed.primitive["attributes"]["TEXCOORD_0"] = seed.accessor(seed.uv)


def _material(seed: GltfSeed) -> None:
    material: dict[str, Any] = {"name": "lamp", "emissiveFactor": [1, 1, 0.5], "alphaMode": "MASK"}
    material |= {"alphaCutoff": 0.5, "doubleSided": True, "pbrMetallicRoughness": {"metallicFactor": 0.0}}
    seed.extension(material, "KHR_materials_emissive_strength", {"emissiveStrength": 3.0})
    seed.extension(material, "KHR_materials_unlit", {})
    seed.extension(material, "KHR_materials_transmission", {"transmissionFactor": 0.5})
    if seed.rng.random() < 0.5:
        seed.extension(material, "KHR_materials_pbrSpecularGlossiness", {"diffuseFactor": [0.5, 0.5, 0.5, 1]})
    seed.primitive["material"] = seed.add("materials", material)


def _lights_and_cameras(seed: GltfSeed) -> None:
    lights: list[dict[str, Any]] = [
        {"type": "spot", "intensity": 5.0, "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.7}},
        {"type": "point", "color": [1, 0.9, 0.8], "range": 20.0},
        {"type": "directional", "name": "sun"},
    ]
    seed.extension(seed.document, "KHR_lights_punctual", {"lights": lights})
    seed.extension(seed.document["nodes"][2], "KHR_lights_punctual", {"light": seed.rng.randrange(3)})
    perspective = {"yfov": 0.8, "znear": 0.1, "zfar": 100.0, "aspectRatio": 1.5}
    seed.document["nodes"][1]["camera"] = seed.add(
        "cameras", {"type": "perspective", "perspective": perspective}
    )
    seed.extension(seed.document["nodes"][1], "KHR_node_visibility", {"visible": True})


def _morph(seed: GltfSeed) -> None:
    seed.primitive["targets"] = [{"POSITION": seed.accessor(0.1 * seed.positions)}]
    seed.document["meshes"][0]["weights"] = [0.5]


def _skin(seed: GltfSeed) -> None:
    matrices = np.tile(np.eye(4, dtype=np.float32).reshape(1, 16), (2, 1))
    skin = {"joints": [1, 2], "inverseBindMatrices": seed.accessor(matrices)}
    seed.document["nodes"][0]["skin"] = seed.add("skins", skin)
    count = len(seed.positions)
    seed.primitive["attributes"]["JOINTS_0"] = seed.accessor(np.zeros((count, 4), np.uint8))
    seed.primitive["attributes"]["WEIGHTS_0"] = seed.accessor(np.full((count, 4), 0.25, np.float32))


def _animation(seed: GltfSeed) -> None:
    times = seed.accessor(np.array([0, 0.5, 1], np.float32), min=[0], max=[1])
    moves = seed.accessor(np.eye(3, dtype=np.float32))
    turns = seed.accessor(np.tile(np.array([0, 0, 0, 1], np.float32), (9, 1)))
    samplers = [
        {"input": times, "output": moves, "interpolation": "LINEAR"},
        {"input": times, "output": turns, "interpolation": "CUBICSPLINE"},
    ]
    channels = [
        {"sampler": 0, "target": {"node": 1, "path": "translation"}},
        {"sampler": 1, "target": {"node": 2, "path": "rotation"}},
    ]
    seed.add("animations", {"samplers": samplers, "channels": channels})


def _instancing(seed: GltfSeed) -> None:
    places = seed.accessor(np.eye(3, dtype=np.float32))
    turns = seed.accessor(np.tile(np.array([0, 0, 0, 1], np.float32), (3, 1)))
    attributes = {"TRANSLATION": places, "ROTATION": turns}
    seed.extension(seed.document["nodes"][0], "EXT_mesh_gpu_instancing", {"attributes": attributes})


def _sparse(seed: GltfSeed) -> None:
    accessor = seed.document["accessors"][seed.primitive["attributes"]["POSITION"]]
    accessor["sparse"] = {
        "count": 1,
        "indices": {"bufferView": seed.view(bytes([1])), "byteOffset": 0, "componentType": 5121},
        "values": {"bufferView": seed.view(np.array([1, 1, 0], np.float32).tobytes()), "byteOffset": 0},
    }


def _transforms(seed: GltfSeed) -> None:
    seed.document["nodes"][0] |= {"rotation": [0, 0, 0, 1], "scale": [1, 2, 1]}
    seed.document["nodes"][2]["matrix"] = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]


def _draco(seed: GltfSeed) -> None:
    stream = DracoPy.encode(seed.positions, seed.triangles.astype(np.uint32), preserve_order=True)
    seed.extension(
        seed.primitive,
        "KHR_draco_mesh_compression",
        {"bufferView": seed.view(stream), "attributes": {"POSITION": 0}},
    )


def _meshopt(seed: GltfSeed) -> None:
    accessor = seed.document["accessors"][seed.primitive["attributes"]["POSITION"]]
    view = seed.document["bufferViews"][accessor["bufferView"]]
    rows = seed.positions.view(np.uint8).reshape(len(seed.positions), 12)
    stream = _meshopt_attributes(rows)
    place = seed.document["bufferViews"][seed.view(stream)]
    packed = {"mode": "ATTRIBUTES", "byteStride": 12, "count": len(rows), "filter": "NONE"}
    seed.extension(view, "EXT_meshopt_compression", place | packed)


def _meshopt_attributes(rows: np.ndarray) -> bytes:
    """At most 256 rows, encoded as EXT_meshopt_compression has it, every group of 16 in full bytes."""
    signed = np.diff(rows, axis=0, prepend=rows[:1]).astype(np.int8).astype(np.int16)
    zigzag = np.where(signed < 0, -2 * signed - 1, 2 * signed).astype(np.uint8)
    groups = -(-len(rows) // 16)
    padded = np.zeros((groups * 16, rows.shape[1]), np.uint8)
    padded[: len(rows)] = zigzag
    columns = b"".join(b"\xff" * -(-groups // 4) + column.tobytes() for column in padded.T)
    return b"\xa0" + columns + bytes(32 - rows.shape[1]) + rows[0].tobytes()


_FEATURES = (
    *(_attributes, _texture, _material, _lights_and_cameras, _morph, _skin, _animation, _instancing),
    *(_sparse, _transforms, _meshopt),
)
