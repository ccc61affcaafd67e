"""glTF materials: base-colour factors and textures. A diffuse material has no use for the rest."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, UInt8

from vpltune.renderer.scene.files.diagnostics import SceneFileError, label
from vpltune.renderer.scene.files.gltf_accessors import GltfAccessors
from vpltune.renderer.scene.files.gltf_buffers import read_uri
from vpltune.renderer.scene.files.gltf_document import GltfDocument
from vpltune.renderer.scene.files.image_texels import GLTF_FORMATS, ImageDecoder
from vpltune.renderer.scene.files.json_object import JsonObject, shown
from vpltune.renderer.scene.scene import Material, Texture, Wrap

# OpenGL enums of wrap modes, as a glTF sampler gives them.
_WRAPS: dict[int, Wrap] = {33071: "clamp_to_edge", 33648: "mirrored_repeat", 10497: "repeat"}
# And of nearest filters.
_NEAREST_FILTERS = (9728, 9984, 9986)

# Extensions in place of metallic-roughness, so that its metallicFactor says nothing.
_WITHOUT_METAL = ("KHR_materials_pbrSpecularGlossiness", "KHR_materials_unlit")


@dataclass(frozen=True, eq=False)
class BaseColor:
    """The base colour of a primitive: its material, and how its texture is looked up."""

    material: int
    """Index into the scene's materials."""
    uv_set: int | None = None
    """The set of texture coordinates, n of TEXCOORD_n; None without a texture."""
    uv_transform: Float64[np.ndarray, "2 3"] | None = None
    """The KHR_texture_transform, if any."""


class GltfMaterials:
    """The materials and textures that the scene's primitives use. Each is read once, when first used."""

    def __init__(self, document: GltfDocument, accessors: GltfAccessors) -> None:
        self._document = document
        self._buffers = accessors.buffers
        self._decoder = ImageDecoder(GLTF_FORMATS)
        self.materials: list[Material] = []
        self.textures: list[Texture] = []
        self._base_colors: dict[str, BaseColor] = {}
        self._texture_indices: dict[tuple[str, Wrap, Wrap], int] = {}
        self._texels: dict[str, UInt8[np.ndarray, "height width 3"]] = {}

    def of(self, primitive: JsonObject) -> BaseColor:
        """The base colour of a primitive; white if the primitive has no material.

        Raises:
            SceneFileError: the material, its texture or its image is invalid or missing.
        """
        material = self._document.referred(primitive, "material", "materials")
        if material is None:
            material = JsonObject({"name": "default"}, "")
        if material.where not in self._base_colors:
            self._base_colors[material.where] = self._read(material)
        return self._base_colors[material.where]

    def _read(self, material: JsonObject) -> BaseColor:
        holder, factor_key, texture_key = self._base_color_keys(material)
        factor = holder.numbers(factor_key, 4, default=(1.0, 1.0, 1.0, 1.0))[:3]
        # 1e-6 accepts a 1 in single precision, such as 1.0000001.
        if (factor < 0.0).any() or (factor > 1.0 + 1e-6).any():
            raise SceneFileError(f"{holder.at(factor_key)}: must lie in [0, 1], got {shown(factor.tolist())}")
        self._warn_of_ignored(material)
        info = holder.object(texture_key)
        texture = None if info is None else self._texture(info)
        name = label(material.string("name", ""), f"material {len(self.materials)}")
        base_color = np.minimum(factor, 1.0).astype(np.float32)
        self.materials.append(Material(name, base_color, texture))
        if info is None or texture is None:
            return BaseColor(len(self.materials) - 1)
        transform = info.extension("KHR_texture_transform")
        uv_set = info.integer("texCoord", 0)
        if transform is None:
            return BaseColor(len(self.materials) - 1, uv_set)
        return BaseColor(
            len(self.materials) - 1, transform.integer("texCoord", uv_set), _uv_transform(transform)
        )

    def _base_color_keys(self, material: JsonObject) -> tuple[JsonObject, str, str]:
        specular = material.extension("KHR_materials_pbrSpecularGlossiness")
        if specular is not None:
            self._document.warnings.tally(
                "1 material is specular-glossiness: its diffuse colour is used",
                "{n} materials are specular-glossiness: their diffuse colour is used",
            )
            return specular, "diffuseFactor", "diffuseTexture"
        metallic = material.object("pbrMetallicRoughness")
        return metallic or JsonObject({}, material.where), "baseColorFactor", "baseColorTexture"

    def _warn_of_ignored(self, material: JsonObject) -> None:
        warnings = self._document.warnings
        emissive = material.numbers("emissiveFactor", 3, default=(0.0, 0.0, 0.0))
        strength = material.extension("KHR_materials_emissive_strength")
        if (emissive > 0.0).any() and (strength is None or strength.number("emissiveStrength", 1.0) > 0.0):
            warnings.tally(
                "1 material emits light; emission does not light the scene yet",
                "{n} materials emit light; emission does not light the scene yet",
            )
        self._warn_of_metal(material)
        if material.string("alphaMode", "OPAQUE") != "OPAQUE":
            warnings.tally(
                "1 material has an alpha mode; it is drawn opaque",
                "{n} materials have an alpha mode; they are drawn opaque",
            )
        for name in ("KHR_materials_transmission", "KHR_materials_diffuse_transmission"):
            if material.extension(name) is not None:
                warnings.tally(
                    "1 material transmits light; it is drawn opaque",
                    "{n} materials transmit light; they are drawn opaque",
                )
        if material.extension("KHR_materials_unlit") is not None:
            warnings.tally(
                "1 material is marked unlit; it is lit like any other",
                "{n} materials are marked unlit; they are lit like any other",
            )

    def _warn_of_metal(self, material: JsonObject) -> None:
        holder = material.object("pbrMetallicRoughness")
        # By the letter, what leaves the whole object out is a white metal: a placeholder, not worth a word.
        if holder is None or any(map(material.extension, _WITHOUT_METAL)):
            return
        if holder.number("metallicFactor", 1.0) <= 0.0:
            return
        by = " by its texture" if holder.object("metallicRoughnessTexture") is not None else ""
        self._document.warnings.tally(
            f"1 material is metallic{by}; it is drawn matt, in its base colour",
            f"{{n}} materials are metallic{by.replace('its', 'their')}; they are drawn matt, in their base "
            "colours",
        )

    def _texture(self, info: JsonObject) -> int | None:
        textures = self._document.list_of("textures")
        texture = textures[info.required_index("index", len(textures), "textures")]
        image = self._image(texture)
        if image is None:
            self._document.warnings.tally(
                "1 texture has no image in a supported format; white is used",
                "{n} textures have no image in a supported format; white is used",
            )
            return None
        wrap_u, wrap_v = self._wraps(texture)
        key = (image.where, wrap_u, wrap_v)
        if key not in self._texture_indices:
            self._texture_indices[key] = len(self.textures)
            name = label(image.string("name", ""), image.where)
            self.textures.append(Texture(name, self._texels_of(image), wrap_u, wrap_v))
        return self._texture_indices[key]

    def _image(self, texture: JsonObject) -> JsonObject | None:
        webp = texture.extension("EXT_texture_webp")
        if webp is not None and "source" in webp.members:
            return self._document.referred(webp, "source", "images")
        return self._document.referred(texture, "source", "images")

    def _wraps(self, texture: JsonObject) -> tuple[Wrap, Wrap]:
        sampler = self._document.referred(texture, "sampler", "samplers")
        if sampler is None:
            return "repeat", "repeat"
        modes = [sampler.integer(key, 10497) for key in ("wrapS", "wrapT")]
        for key, mode in zip(("wrapS", "wrapT"), modes, strict=True):
            if mode not in _WRAPS:
                raise SceneFileError(
                    f"{sampler.at(key)}: must be one of {', '.join(map(str, _WRAPS))}, got {mode}"
                )
        if sampler.members.get("magFilter") in _NEAREST_FILTERS:
            self._document.warnings.tally(
                "1 texture asks for nearest filtering; it is filtered bilinearly",
                "{n} textures ask for nearest filtering; they are filtered bilinearly",
            )
        return _WRAPS[modes[0]], _WRAPS[modes[1]]

    def _texels_of(self, image: JsonObject) -> UInt8[np.ndarray, "height width 3"]:
        if image.where not in self._texels:
            if "uri" in image.members:
                content: bytes | memoryview = read_uri(self._document, image)
            else:
                content = self._buffers.view(image)[0]
            source = image.string("uri", "")
            where = image.where if source[:5].lower() in ("", "data:") else f"{image.where} {source!r:.80}"
            self._texels[image.where] = self._decoder.decode(content, where)
        return self._texels[image.where]


def _uv_transform(transform: JsonObject) -> Float64[np.ndarray, "2 3"]:
    """KHR_texture_transform as a 2 × 3 matrix: translation · rotation · scale.

    The rotation is counter-clockwise with v pointing down. The extension's prose, its worked example and the
    implementations agree on this; the code listing in the first version had the opposite sign (Khronos glTF
    issue 1563).
    """
    offset = transform.numbers("offset", 2, default=(0.0, 0.0))
    scale = transform.numbers("scale", 2, default=(1.0, 1.0))
    angle = transform.number("rotation", 0.0)
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array(
        [[cos * scale[0], sin * scale[1], offset[0]], [-sin * scale[0], cos * scale[1], offset[1]]]
    )


def transformed_uv(
    uv: Float32[np.ndarray, "n 2"], transform: Float64[np.ndarray, "2 3"] | None
) -> Float32[np.ndarray, "n 2"]:
    """Texture coordinates transformed by `BaseColor.uv_transform`; unchanged if it is None."""
    if transform is None:
        return uv
    return (uv.astype(np.float64) @ transform[:, :2].T + transform[:, 2]).astype(np.float32)
