"""glTF mesh primitives: triangle lists, strips and fans, converted to meshes."""

import re

import numpy as np
from jaxtyping import Float32, Int64

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.gltf_accessors import Elements, GltfAccessors
from vpltune.renderer.scene.files.gltf_deformation import Deformation, morphed, read_influences, skinned
from vpltune.renderer.scene.files.gltf_document import GltfDocument
from vpltune.renderer.scene.files.gltf_draco import decode_draco
from vpltune.renderer.scene.files.gltf_materials import BaseColor
from vpltune.renderer.scene.files.gltf_textures import transformed_uv
from vpltune.renderer.scene.files.json_object import JsonObject
from vpltune.renderer.scene.files.limited_decoder import LimitedDecoder
from vpltune.renderer.scene.files.limits import MAX_MORPH_BYTES, DecodedBytes
from vpltune.renderer.scene.files.opacity import OPAQUE
from vpltune.renderer.scene.files.surface import Surface, finished_mesh, used_vertices
from vpltune.renderer.scene.scene import Mesh
from vpltune.renderer.scene.scene_animation import Skinning

# OpenGL enums of primitive modes, as in glTF. Smaller ones are points and lines.
_TRIANGLES, _TRIANGLE_STRIP, _TRIANGLE_FAN = 4, 5, 6

# Accessor types of vertex attributes (glTF 2.0 section 3.7.2.1).
_ATTRIBUTE_TYPES = {
    "POSITION": ("VEC3",),
    "NORMAL": ("VEC3",),
    "TEXCOORD": ("VEC2",),
    "COLOR": ("VEC3", "VEC4"),
    "JOINTS": ("VEC4",),
    "WEIGHTS": ("VEC4",),
}


class GltfPrimitives:
    """Reads the mesh primitives of one document."""

    def __init__(self, document: GltfDocument, accessors: GltfAccessors, draco: LimitedDecoder) -> None:
        self._document = document
        self._accessors = accessors
        self._draco = draco
        self._morphs = DecodedBytes(MAX_MORPH_BYTES, "morph targets")

    def is_surface(self, primitive: JsonObject) -> bool:
        """Whether a primitive has triangles with positions. If not, this adds a warning.

        Raises:
            SceneFileError: the mode is out of range, or the primitive has no attributes.
        """
        warnings = self._document.warnings
        if primitive.integer("mode", _TRIANGLES, high=_TRIANGLE_FAN) < _TRIANGLES:
            warnings.tally(
                "1 primitive of points or lines is ignored", "{n} primitives of points or lines are ignored"
            )
            return False
        if "POSITION" not in primitive.required_object("attributes").members:
            warnings.tally(
                "1 primitive without positions is ignored", "{n} primitives without positions are ignored"
            )
            return False
        return True

    def read(
        self, primitive: JsonObject, name: str, base_color: BaseColor, deformation: Deformation
    ) -> Mesh | None:
        """The mesh of a primitive at rest, in world space if it is skinned and else in its node's space.

        Args:
            primitive: the primitive object.
            name: of the mesh.
            base_color: its material, and the texture coordinates to read.
            deformation: morph weights and skin.

        Returns:
            None if no triangle has area.

        Raises:
            SceneFileError: an index is out of range, attributes differ in count, or data are invalid.
        """
        attributes, corners = self._attributes_and_corners(primitive, base_color, deformation)
        triangles = _triangles(corners, primitive.integer("mode", _TRIANGLES), primitive.where)
        if not len(triangles):
            return None
        self._document.decoded.spend(triangles.nbytes, primitive.where)
        used, renumbered = used_vertices(triangles.ravel(), len(attributes["POSITION"]))
        positions, normals, skinning = self._at_rest(primitive, attributes, used, deformation)
        surface = Surface(
            positions,
            renumbered.reshape(-1, 3),
            normals,
            self._uv(attributes, used, base_color),
            self._colors(attributes, used, base_color.has_alpha),
            skinning,
        )
        return finished_mesh(surface, name, base_color.material, self._document.decoded, primitive.where)

    def _attributes_and_corners(
        self, primitive: JsonObject, base_color: BaseColor, deformation: Deformation
    ) -> tuple[dict[str, Elements], Int64[np.ndarray, " corners"]]:
        compression = primitive.extension("KHR_draco_mesh_compression")
        attributes: dict[str, Elements] = {}
        corners = None
        if compression is not None:
            if primitive.integer("mode", _TRIANGLES) != _TRIANGLES:
                raise SceneFileError(
                    f"{primitive.at('mode')}: Draco geometry is read as triangles (mode 4) only"
                )
            attributes, corners = decode_draco(
                self._accessors, primitive, compression, self._document.decoded, self._draco
            )
        holder = primitive.required_object("attributes")
        for semantic in holder.members:
            if semantic not in attributes and _is_wanted(semantic, base_color, deformation):
                types = _ATTRIBUTE_TYPES[semantic.partition("_")[0]]
                attributes[semantic] = self._accessors.referred(holder, semantic, types)
        vertex_count = len(attributes["POSITION"])
        for semantic, elements in attributes.items():
            if len(elements) != vertex_count:
                raise SceneFileError(
                    f"{elements.where}: {semantic} must have the {vertex_count} elements of POSITION, "
                    f"got {len(elements)}"
                )
        if corners is None:
            if "NORMAL" not in attributes and primitive.integer("mode", _TRIANGLES) == _TRIANGLES:
                self._require_flat(primitive, vertex_count)
            corners = self._corners(primitive, vertex_count)
        if corners.min() < 0 or corners.max() >= vertex_count:
            raise SceneFileError(
                f"{primitive.at('indices')}: must be below the {vertex_count} vertices, got {corners.max()}"
            )
        return attributes, corners

    def _require_flat(self, primitive: JsonObject, vertex_count: int) -> None:
        """Refuse a flat mesh that is too large from its count alone: each corner becomes a vertex."""
        indexed = "indices" in primitive.members
        corner_count = self._accessors.count(primitive, "indices") if indexed else vertex_count
        # Indices twice in 8 bytes, then position, normal and index.
        self._document.decoded.require((16 + 24 + 4) * corner_count, primitive.where)

    def _corners(self, primitive: JsonObject, vertex_count: int) -> Int64[np.ndarray, " corners"]:
        if "indices" not in primitive.members:
            self._document.decoded.spend(8 * vertex_count, primitive.where)
            return np.arange(vertex_count, dtype=np.int64)
        indices = self._accessors.referred(primitive, "indices", ("SCALAR",))
        stored = indices.stored[:, 0]
        if stored.dtype.kind != "u" or indices.normalized:
            raise SceneFileError(
                f"{indices.where}: indices must be plain unsigned integers, got {stored.dtype.name}"
            )
        self._document.decoded.spend(8 * len(stored), indices.where)
        largest = np.iinfo(stored.dtype).max
        if (stored == largest).any():
            raise SceneFileError(f"{indices.where}: must not hold {largest}, which means primitive restart")
        return stored.astype(np.int64)

    def _at_rest(
        self,
        primitive: JsonObject,
        attributes: dict[str, Elements],
        used: Int64[np.ndarray, " used"],
        deformation: Deformation,
    ) -> tuple[Float32[np.ndarray, "used 3"], Float32[np.ndarray, "used 3"] | None, Skinning | None]:
        """Morphed and skinned positions and normals of the used vertices, and the skinning if animated."""
        placed: dict[str, Float32[np.ndarray, "used 3"]] = {}
        for semantic in ("POSITION", "NORMAL"):
            if semantic in attributes:
                base = attributes[semantic].as_floats(used)
                if base.shape[1] != 3:
                    raise SceneFileError(
                        f"{attributes[semantic].where}: must have 3 components, got {base.shape[1]}"
                    )
                vertex_count = len(attributes[semantic])
                placed[semantic] = morphed(
                    base,
                    semantic,
                    primitive,
                    deformation.weights,
                    self._accessors,
                    used,
                    vertex_count,
                    self._morphs,
                )
        positions, normals = placed["POSITION"], placed.get("NORMAL")
        if deformation.skin is None or "JOINTS_0" not in attributes:
            return positions, normals, None
        joints, weights = read_influences(
            attributes, used, len(deformation.skin.joints), self._document.decoded
        )
        at_rest = skinned(positions, normals, joints, weights, deformation.skin.joint_to_world)
        if not deformation.skin.is_animated:
            return *at_rest, None
        bind_normals = np.zeros_like(positions) if normals is None else normals
        return *at_rest, Skinning(positions, bind_normals, joints, weights.astype(np.float32))

    def _uv(
        self, attributes: dict[str, Elements], used: Int64[np.ndarray, " used"], base_color: BaseColor
    ) -> Float32[np.ndarray, "used 2"] | None:
        if base_color.uv_set is None:
            return None
        stored = attributes.get(f"TEXCOORD_{base_color.uv_set}")
        if stored is None:
            self._document.warnings.tally(
                "1 textured primitive has no texture coordinates; (0, 0) is used",
                "{n} textured primitives have no texture coordinates; (0, 0) is used",
            )
            uv = np.zeros((len(used), 2), np.float32)
        else:
            uv = stored.as_floats(used)
        return transformed_uv(uv, base_color.uv_transform)

    def _colors(
        self, attributes: dict[str, Elements], used: Int64[np.ndarray, " used"], has_alpha: bool
    ) -> Float32[np.ndarray, "used 3"] | None:
        if "COLOR_0" not in attributes:
            return None
        stored = attributes["COLOR_0"].as_floats(used)
        colors, alpha = stored[:, :3], stored[:, 3:]
        if has_alpha and alpha.size and alpha.min() < OPAQUE:
            self._document.warnings.tally(
                "1 primitive has vertex colours with alpha; alpha counts as 1",
                "{n} primitives have vertex colours with alpha; alpha counts as 1",
            )
        if colors.min() < 0.0 or colors.max() > 1.0:
            self._document.warnings.tally(
                "1 primitive has vertex colours outside [0, 1]; they are clamped",
                "{n} primitives have vertex colours outside [0, 1]; they are clamped",
            )
        return np.clip(colors, 0.0, 1.0)


def _is_wanted(semantic: str, base_color: BaseColor, deformation: Deformation) -> bool:
    if semantic in ("POSITION", "NORMAL", "COLOR_0"):
        return True
    if deformation.skin is not None and re.fullmatch(r"(JOINTS|WEIGHTS)_\d", semantic):
        return True
    return base_color.uv_set is not None and semantic == f"TEXCOORD_{base_color.uv_set}"


def _triangles(
    corners: Int64[np.ndarray, " corners"], mode: int, where: str
) -> Int64[np.ndarray, "triangles 3"]:
    """The triangles of a list, strip or fan, with the winding of glTF 2.0 section 3.7.2.1."""
    if mode == _TRIANGLES:
        if len(corners) % 3:
            raise SceneFileError(
                f"{where}: a triangle list must have a multiple of 3 corners, got {len(corners)}"
            )
        return corners.reshape(-1, 3)
    if len(corners) < 3:
        return np.empty((0, 3), np.int64)
    if mode == _TRIANGLE_FAN:
        first = np.full(len(corners) - 2, corners[0])
        return np.stack([corners[1:-1], corners[2:], first], axis=1)
    triangles = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
    triangles[1::2, 1:] = triangles[1::2, :0:-1]  # every second triangle of a strip is reversed
    return triangles
