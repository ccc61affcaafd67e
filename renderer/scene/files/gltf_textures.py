"""glTF textures: images, wrap modes and coordinates, and the products of images that one material uses."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, UInt8

from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.scene.files.diagnostics import SceneFileError, label
from vpltune.renderer.scene.files.gltf_accessors import GltfAccessors
from vpltune.renderer.scene.files.gltf_buffers import read_uri
from vpltune.renderer.scene.files.gltf_document import GltfDocument
from vpltune.renderer.scene.files.image_texels import GLTF_FORMATS, ImageDecoder
from vpltune.renderer.scene.files.json_object import JsonObject
from vpltune.renderer.scene.files.ktx2_images import Ktx2Decoder, is_ktx2
from vpltune.renderer.scene.files.limited_decoder import LimitedDecoder
from vpltune.renderer.scene.files.texel_products import dimmed, of_size
from vpltune.renderer.scene.scene import Texture, Wrap

# OpenGL enums of wrap modes, as a glTF sampler gives them.
_WRAPS: dict[int, Wrap] = {33071: "clamp_to_edge", 33648: "mirrored_repeat", 10497: "repeat"}
# And of nearest filters.
_NEAREST_FILTERS = (9728, 9984, 9986)


@dataclass(frozen=True, eq=False)
class Layers:
    """The images whose product is one texture. All are looked up at the same coordinates."""

    color: JsonObject | None = None
    """A textureInfo; None for white."""
    metal: JsonObject | None = None
    """A textureInfo of which the blue channel is the metalness; None where none dims the colour."""
    metallic: float = 0.0
    """The factor on that."""
    has_alpha: bool = False
    """Whether the colour's alpha counts as opacity."""

    @property
    def placed(self) -> JsonObject | None:
        """The textureInfo that says where the texture lies; None without any."""
        return self.metal if self.color is None else self.color


class GltfTextures:
    """The textures that the scene's materials use. Each image is decoded once, when first used."""

    def __init__(self, document: GltfDocument, accessors: GltfAccessors, ktx2: LimitedDecoder) -> None:
        self._document = document
        self._buffers = accessors.buffers
        self._decoder = ImageDecoder(GLTF_FORMATS)
        self._ktx2 = Ktx2Decoder(self._decoder, ktx2)
        self.textures: list[Texture] = []
        self._indices: dict[tuple[object, ...], int] = {}
        self._texels: dict[str, UInt8[np.ndarray, "height width _"]] = {}
        self._opacities: dict[str, UInt8[np.ndarray, "height width"] | None] = {}

    def of(self, layers: Layers) -> int | None:
        """The index of a texture; None where it has no image in a supported format.

        Raises:
            SceneFileError: a texture or an image is invalid or missing, or texels are too many.
        """
        if layers.placed is None:
            return None
        color = None if layers.color is None else self.image(layers.color)
        metal = None if layers.metal is None else self.image(layers.metal)
        if layers.color is not None and color is None:
            self._document.warnings.tally(
                "1 texture has no image in a supported format; white is used",
                "{n} textures have no image in a supported format; white is used",
            )
        named = metal if color is None else color
        if named is None:
            return None
        wrap_u, wrap_v = self._wraps(self._texture(layers.placed))
        opacity = self._opacity(color) if layers.has_alpha and color is not None else None
        metallic = metal and (metal.where, layers.metallic)
        key = (color and color.where, metallic, opacity is not None, wrap_u, wrap_v)
        if key not in self._indices:
            self._indices[key] = len(self.textures)
            texels = self._color_texels(color, metal, layers.metallic)
            if opacity is not None:
                opacity = of_size(opacity, texels.shape[1], texels.shape[0])
            name = label(named.string("name", ""), named.where)
            self.textures.append(Texture(name, texels, wrap_u, wrap_v, opacity))
        return self._indices[key]

    def image(self, info: JsonObject) -> JsonObject | None:
        """The image that a textureInfo refers to; None where it has no supported format."""
        texture = self._texture(info)
        webp = texture.extension("EXT_texture_webp")
        if webp is not None and "source" in webp.members:
            return self._document.referred(webp, "source", "images")
        plain = self._document.referred(texture, "source", "images")
        basisu = texture.extension("KHR_texture_basisu")
        # A plain image is the same without the loss of block compression, so it goes first.
        if plain is None and basisu is not None:
            return self._document.referred(basisu, "source", "images")
        return plain

    def texels(self, image: JsonObject) -> UInt8[np.ndarray, "height width _"]:
        """The texels of an image, as the file has them: sRGB-encoded colours, or plain numbers."""
        if image.where not in self._texels:
            content, where = self._content(image)
            self._texels[image.where] = self._decoder_of(content).decode(content, where)
        return self._texels[image.where]

    def _opacity(self, image: JsonObject) -> UInt8[np.ndarray, "height width"] | None:
        if image.where not in self._opacities:
            content, where = self._content(image)
            self._opacities[image.where] = self._decoder_of(content).opacity(content, where)
        return self._opacities[image.where]

    def _decoder_of(self, content: bytes | memoryview) -> ImageDecoder | Ktx2Decoder:
        return self._ktx2 if is_ktx2(content) else self._decoder

    def _content(self, image: JsonObject) -> tuple[bytes | memoryview, str]:
        """The bytes of an image file, and its place for messages."""
        if "uri" in image.members:
            content: bytes | memoryview = read_uri(self._document, image)
        else:
            content = self._buffers.view(image)[0]
        source = image.string("uri", "")
        is_named = source[:5].lower() not in ("", "data:")
        return content, f"{image.where} {source!r:.80}" if is_named else image.where

    def mean_color(self, info: JsonObject) -> Float64[np.ndarray, "3"]:
        """Mean linear colour of a texture, over at most 256² of its texels; white without an image."""
        image = self.image(info)
        if image is None:
            return np.ones(3)
        texels = self.texels(image)
        rows, columns = (-(-size // 256) for size in texels.shape[:2])
        return linear_from_srgb(texels[::rows, ::columns] / 255.0).mean(axis=(0, 1))

    def mean_red(self, info: JsonObject) -> float:
        """Mean of a texture's red channel, taken as a plain number in [0, 1]; 1 without an image."""
        image = self.image(info)
        return 1.0 if image is None else float(self.texels(image)[..., 0].mean()) / 255.0

    def _texture(self, info: JsonObject) -> JsonObject:
        textures = self._document.list_of("textures")
        return textures[info.required_index("index", len(textures), "textures")]

    def _color_texels(
        self, color: JsonObject | None, metal: JsonObject | None, metallic: float
    ) -> UInt8[np.ndarray, "height width 3"]:
        texels = None if color is None else self.texels(color)
        if metal is None:
            assert texels is not None
            return texels
        metalness = self.texels(metal)[..., 2]
        shape = metalness.shape if texels is None else np.maximum(metalness.shape, texels.shape[:2])
        height, width = map(int, shape)
        self._decoder.spend(width * height, f"metallic texels of {width} × {height}", metal.where)
        white = np.full((height, width, 3), 255, np.uint8)
        texels = white if texels is None else of_size(texels, width, height)
        return dimmed(texels, of_size(metalness, width, height), metallic)

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


def uv_set(info: JsonObject) -> int:
    """n of the TEXCOORD_n with which a texture is looked up."""
    transform = info.extension("KHR_texture_transform")
    own = info.integer("texCoord", 0)
    return own if transform is None else transform.integer("texCoord", own)


def uv_transform(info: JsonObject) -> Float64[np.ndarray, "2 3"] | None:
    """KHR_texture_transform as a 2 × 3 matrix: translation · rotation · scale; None without one.

    The rotation is counter-clockwise with v pointing down. The extension's prose, its worked example and the
    implementations agree on this; the code listing in the first version had the opposite sign (Khronos glTF
    issue 1563).
    """
    transform = info.extension("KHR_texture_transform")
    if transform is None:
        return None
    offset = transform.numbers("offset", 2, default=(0.0, 0.0))
    scale = transform.numbers("scale", 2, default=(1.0, 1.0))
    angle = transform.number("rotation", 0.0)
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array(
        [[cos * scale[0], sin * scale[1], offset[0]], [-sin * scale[0], cos * scale[1], offset[1]]]
    )


def placed_alike(a: JsonObject, b: JsonObject) -> bool:
    """Whether two textures are looked up at the same coordinates."""
    first, second = uv_transform(a), uv_transform(b)
    if first is None or second is None:
        return uv_set(a) == uv_set(b) and first is second
    return uv_set(a) == uv_set(b) and np.array_equal(first, second)


def transformed_uv(
    uv: Float32[np.ndarray, "n 2"], transform: Float64[np.ndarray, "2 3"] | None
) -> Float32[np.ndarray, "n 2"]:
    """Texture coordinates transformed by a matrix of `uv_transform`; unchanged if it is None."""
    if transform is None:
        return uv
    return (uv.astype(np.float64) @ transform[:, :2].T + transform[:, 2]).astype(np.float32)
