"""A scene as one self-contained .glb, which `read_scene` gives back the same."""

import io
import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64
from PIL import Image

from vpltune.renderer.files.atomic_file import written_whole
from vpltune.renderer.scene.files.surface import turned
from vpltune.renderer.scene.scene import Instance, Light, Material, Mesh, Scene, Texture

# OpenGL's numbers, which glTF uses: glTF 2.0, "Accessor", "Buffer View" and "Sampler".
_FLOAT, _UNSIGNED_INT = 5126, 5125
# As above.
_ARRAY_BUFFER, _ELEMENT_ARRAY_BUFFER = 34962, 34963
_WRAPS = {"repeat": 10497, "mirrored_repeat": 33648, "clamp_to_edge": 33071}
# As above.
_LINEAR, _LINEAR_MIPMAP_LINEAR = 9729, 9987
# glTF asks a camera for planes that ours have not: in the scene's diagonals, wide enough for any viewer.
_NEAREST, _FARTHEST = 1e-4, 1e2


def write_glb(path: Path, scene: Scene, *, notes: tuple[str, ...] = ()) -> None:
    """Write `scene` to `path`, whole or not at all; `notes` go into the asset's extras.

    Positions, texture coordinates and colours keep their float32 bits, textures their texels (as PNG), and
    transforms their float64 digits. Materials become matt and two-sided, which is what ours are, with their
    alpha and their emission; what emits on one side alone is called one-sided, since glTF has one word for
    both. The environment is not written: glTF has none.

    Raises:
        InputError: the path cannot be written to.
        ValueError: the scene has an animation, which is not written.
    """
    if scene.animation is not None:
        raise ValueError(f"scene: {scene.name} has an animation, which write_glb does not write")
    content = _GlbDocument(scene, notes).content()
    with written_whole(path) as temporary:
        temporary.write_bytes(content)


class _GlbDocument:
    def __init__(self, scene: Scene, notes: tuple[str, ...]):
        self._binary = bytearray()
        self._root: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "VPLtune"}
            | ({"extras": {"notes": list(notes)}} if notes else {}),
            "scene": 0,
        }
        diagonal = float(np.linalg.norm(scene.bounds()[1] - scene.bounds()[0]))
        for texture in scene.textures:
            self._add_texture(texture)
        for material in scene.materials:
            surface: dict[str, Any] = {
                "baseColorFactor": [*(float(channel) for channel in material.base_color), material.opacity],
                "metallicFactor": 0.0,
            }
            if material.texture is not None:
                surface["baseColorTexture"] = {"index": material.texture}
            entry = {
                "name": material.name,
                "pbrMetallicRoughness": surface,
                "doubleSided": material.emits_both_ways or not material.glows,
                **self._emission(material),
            }
            if material.is_blended:
                entry["alphaMode"] = "BLEND"
            elif not material.is_opaque:
                entry |= {"alphaMode": "MASK", "alphaCutoff": material.alpha_cutoff}
            self._append("materials", entry)
        for mesh in scene.meshes:
            self._add_mesh(mesh)
        turned_around: dict[int, int] = {}
        for instance in scene.instances:
            index = instance.mesh
            if _shines_behind_in_gltf(scene, instance):
                if index not in turned_around:
                    turned_around[index] = self._add_mesh(turned(scene.meshes[index]))
                index = turned_around[index]
            self._add_node(instance.name, instance.to_world, {"mesh": index})
        for camera in scene.cameras:
            lens = {"yfov": camera.yfov, "znear": _NEAREST * diagonal, "zfar": _FARTHEST * diagonal}
            index = self._append("cameras", {"type": "perspective", "perspective": lens})
            self._add_node(camera.name or "camera", camera.to_world, {"camera": index})
        self._add_lights(scene.lights)
        self._root["scenes"] = [{"name": scene.name, "nodes": list(range(len(self._root.get("nodes", []))))}]
        self._root["buffers"] = [{"byteLength": len(self._binary)}]

    def content(self) -> bytes:
        text = json.dumps(self._root, separators=(",", ":"), allow_nan=False).encode("ascii")
        text += b" " * (-len(text) % 4)
        binary = bytes(self._binary) + bytes(-len(self._binary) % 4)
        chunks = (
            struct.pack("<I4s", len(text), b"JSON")
            + text
            + struct.pack("<I4s", len(binary), b"BIN\0")
            + binary
        )
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks

    def _append(self, kind: str, entry: dict[str, Any]) -> int:
        self._root.setdefault(kind, []).append(entry)
        return len(self._root[kind]) - 1

    def _add_node(self, name: str, to_world: Float64[np.ndarray, "4 4"], holds: dict[str, Any]) -> None:
        node = {"name": name, **holds}
        if not np.array_equal(to_world, np.eye(4)):
            node["matrix"] = to_world.T.ravel().tolist()
        self._append("nodes", node)

    def _buffer_view(self, content: bytes, **properties: int) -> int:
        self._binary.extend(bytes(-len(self._binary) % 4))
        offset = len(self._binary)
        self._binary.extend(content)
        return self._append(
            "bufferViews", {"buffer": 0, "byteOffset": offset, "byteLength": len(content), **properties}
        )

    def _accessor(self, values: np.ndarray, target: int = _ARRAY_BUFFER, bounded: bool = False) -> int:
        entry = {
            "bufferView": self._buffer_view(np.ascontiguousarray(values).tobytes(), target=target),
            "componentType": _FLOAT if values.dtype == np.float32 else _UNSIGNED_INT,
            "count": len(values),
            "type": "SCALAR" if values.ndim == 1 else f"VEC{values.shape[1]}",
        }
        if bounded:
            entry["min"], entry["max"] = values.min(axis=0).tolist(), values.max(axis=0).tolist()
        return self._append("accessors", entry)

    def _add_mesh(self, mesh: Mesh) -> int:
        attributes = {
            "POSITION": self._accessor(mesh.positions, bounded=True),
            "NORMAL": self._accessor(mesh.normals),
        }
        if mesh.uv.any():
            attributes["TEXCOORD_0"] = self._accessor(mesh.uv)
        if not (mesh.colors == 1.0).all():
            attributes["COLOR_0"] = self._accessor(mesh.colors)
        indices = self._accessor(mesh.triangles.ravel().astype(np.uint32), _ELEMENT_ARRAY_BUFFER)
        primitive = {"attributes": attributes, "indices": indices, "material": mesh.material}
        return self._append("meshes", {"name": mesh.name, "primitives": [primitive]})

    def _add_texture(self, texture: Texture) -> None:
        png = io.BytesIO()
        texels = texture.texels_srgb
        if texture.opacity is not None:
            texels = np.concatenate([texels, texture.opacity[..., None]], axis=2)
        Image.fromarray(texels).save(png, "PNG")
        view = self._buffer_view(png.getvalue())
        image = self._append("images", {"name": texture.name, "mimeType": "image/png", "bufferView": view})
        sampler = self._append(
            "samplers",
            {
                "magFilter": _LINEAR,
                "minFilter": _LINEAR_MIPMAP_LINEAR,
                "wrapS": _WRAPS[texture.wrap_u],
                "wrapT": _WRAPS[texture.wrap_v],
            },
        )
        self._append("textures", {"source": image, "sampler": sampler})

    def _emission(self, material: Material) -> dict[str, Any]:
        """The members of a material that say what it emits."""
        if not material.glows:
            return {}
        # glTF's factors end at 1; the rest is the strength.
        strength = max(1.0, *material.emission)
        members: dict[str, Any] = {"emissiveFactor": [channel / strength for channel in material.emission]}
        if material.emission_texture is not None:
            members["emissiveTexture"] = {"index": material.emission_texture}
        if strength > 1.0:
            self._use("KHR_materials_emissive_strength")
            members["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        return members

    def _use(self, extension: str) -> None:
        used = self._root.setdefault("extensionsUsed", [])
        if extension not in used:
            used.append(extension)

    def _add_lights(self, lights: tuple[Light, ...]) -> None:
        if not lights:
            return
        self._use("KHR_lights_punctual")
        entries = self._root["extensions"] = {"KHR_lights_punctual": {"lights": []}}
        for light in lights:
            strongest = float(light.intensity.max())
            entry: dict[str, Any] = {
                "name": light.name,
                "type": light.kind,
                # glTF splits strength and colour; colours above 1 are outside its schema.
                "color": (light.intensity / strongest if strongest > 0.0 else light.intensity).tolist(),
                "intensity": strongest,
            }
            if light.kind == "spot":
                entry["spot"] = {"innerConeAngle": light.inner_cone, "outerConeAngle": light.outer_cone}
            if light.kind != "directional" and light.range < math.inf:
                entry["range"] = light.range
            entries["KHR_lights_punctual"]["lights"].append(entry)
            reference = {"light": len(entries["KHR_lights_punctual"]["lights"]) - 1}
            self._add_node(
                light.name, _light_to_world(light), {"extensions": {"KHR_lights_punctual": reference}}
            )


def _shines_behind_in_gltf(scene: Scene, instance: Instance) -> bool:
    """Whether a glTF reader takes the back for the front: in a mirrored node, clockwise is the front."""
    material = scene.materials[scene.meshes[instance.mesh].material]
    one_way = material.glows and not material.emits_both_ways
    return one_way and bool(np.linalg.det(instance.to_world[:3, :3]) < 0.0)


def _light_to_world(light: Light) -> Float64[np.ndarray, "4 4"]:
    """A rigid motion that takes the origin to the light, and −Z to its direction."""
    backward = -light.direction_world
    side = np.zeros(3)
    side[np.argmin(np.abs(backward))] = 1.0
    right = np.cross(side, backward)
    right /= np.linalg.norm(right)
    to_world = np.eye(4)
    to_world[:3, :3] = np.stack([right, np.cross(backward, right), backward], axis=1)
    to_world[:3, 3] = light.position_world
    return to_world
