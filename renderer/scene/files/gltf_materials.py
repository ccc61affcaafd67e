"""glTF materials: base colours and emission. A diffuse material has no use for the rest."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, UInt8

from vpltune.renderer.scene.files.diagnostics import SceneFileError, label
from vpltune.renderer.scene.files.gltf_accessors import GltfAccessors
from vpltune.renderer.scene.files.gltf_document import GltfDocument
from vpltune.renderer.scene.files.gltf_emission import GltfEmission
from vpltune.renderer.scene.files.gltf_textures import (
    GltfTextures,
    Layers,
    placed_alike,
    uv_set,
    uv_transform,
)
from vpltune.renderer.scene.files.json_object import JsonObject, shown
from vpltune.renderer.scene.files.limited_decoder import LimitedDecoder
from vpltune.renderer.scene.files.opacity import say_blended, without_idle_alpha
from vpltune.renderer.scene.scene import AlphaMode, Material, Texture

_ALPHA_MODES: dict[str, AlphaMode] = {"MASK": "mask", "BLEND": "blend"}

# Extensions in place of metallic-roughness, so that its metallicFactor says nothing.
_WITHOUT_METAL = ("KHR_materials_pbrSpecularGlossiness", "KHR_materials_unlit")


@dataclass(frozen=True, eq=False)
class BaseColor:
    """The base colour of a primitive: its material, and how its texture is looked up."""

    material: int
    """Index into the scene's materials."""
    uv_set: int | None = None
    """The set of texture coordinates, n of TEXCOORD_n, for all textures; None without a texture."""
    uv_transform: Float64[np.ndarray, "2 3"] | None = None
    """The KHR_texture_transform, if any."""
    has_alpha: bool = False
    """Whether the alpha mode of the file lets alpha count, even where no texel and no factor is below 1."""


class GltfMaterials:
    """The materials and textures that the scene's primitives use. Each is read once, when first used."""

    def __init__(self, document: GltfDocument, accessors: GltfAccessors, ktx2: LimitedDecoder) -> None:
        self._document = document
        self._textures = GltfTextures(document, accessors, ktx2)
        self._emission = GltfEmission(document, self._textures)
        self.materials: list[Material] = []
        self._base_colors: dict[str, BaseColor] = {}
        self._left_out: set[str] = set()
        self._unreadable: dict[str, str] = {}
        """Why metallic images cannot be read, by their places."""

    @property
    def textures(self) -> list[Texture]:
        """The textures that the materials refer to."""
        return self._textures.textures

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

    def is_unlit(self, primitive: JsonObject) -> bool:
        """Whether a primitive has its colour without any light: KHR_materials_unlit, as of painted skies."""
        material = self._document.referred(primitive, "material", "materials")
        return material is not None and material.extension("KHR_materials_unlit") is not None

    def leave_out(self, primitive: JsonObject) -> None:
        """Say that surfaces with the material of an unlit primitive are left out; once for each material."""
        material = self._document.referred(primitive, "material", "materials")
        if material is None or material.where in self._left_out:
            return
        self._left_out.add(material.where)
        self._document.warnings.tally(
            "1 material is unlit; its surfaces are left out: they cast no shadow and reflect no light",
            "{n} materials are unlit; their surfaces are left out: they cast no shadow and reflect no light",
        )

    def _read(self, material: JsonObject) -> BaseColor:
        holder, factor_key, texture_key = self._base_color_keys(material)
        factor = holder.numbers(factor_key, 4, default=(1.0, 1.0, 1.0, 1.0))
        # 1e-6 accepts a 1 in single precision, such as 1.0000001.
        if (factor < 0.0).any() or (factor > 1.0 + 1e-6).any():
            raise SceneFileError(f"{holder.at(factor_key)}: must lie in [0, 1], got {shown(factor.tolist())}")
        self._warn_of_ignored(material)
        color = holder.object(texture_key)
        metallic, metal = self._metalness(material, color)
        mode = _ALPHA_MODES.get(material.string("alphaMode", "OPAQUE"), "opaque")
        layers = Layers(color, metal, metallic, has_alpha=mode != "opaque")
        texture = self._textures.of(layers)
        red_green_blue = factor[:3] * (1.0 - metallic) if metal is None else factor[:3]
        name = label(material.string("name", ""), f"material {len(self.materials)}")
        base_color = np.minimum(red_green_blue, 1.0).astype(np.float32)
        read = Material(name, base_color, texture, mode)
        if mode != "opaque":
            read = replace(read, opacity=min(float(factor[3]), 1.0))
        if mode == "mask":
            read = replace(read, alpha_cutoff=material.number("alphaCutoff", 0.5, low=0.0))
        read = self._transmitting(read, material, color, 1.0 - metallic)
        read = without_idle_alpha(read, None if texture is None else self.textures[texture])
        say_blended(read, self._document.warnings)
        placed = None if texture is None else layers.placed
        glow = self._emission.of(material, placed)
        read = replace(
            read,
            emission=glow.radiance,
            emission_texture=glow.texture,
            emits_both_ways=glow.both_ways,
        )
        self.materials.append(read)
        placed = placed or glow.placed
        if placed is None:
            return BaseColor(len(self.materials) - 1, has_alpha=mode != "opaque")
        return BaseColor(len(self.materials) - 1, uv_set(placed), uv_transform(placed), mode != "opaque")

    def _transmitting(
        self, read: Material, material: JsonObject, color: JsonObject | None, matt: float
    ) -> Material:
        """The material with KHR_materials_transmission: of the light that its diffuse base would reflect, the
        share t passes instead, tinted by the base colour. The tint is kept in the mean of the channels alone.
        """
        transmission = material.extension("KHR_materials_transmission")
        share = (
            0.0 if transmission is None else matt * transmission.number("transmissionFactor", 0.0, 0.0, 1.0)
        )
        if transmission is None or share == 0.0:
            return read
        info = transmission.object("transmissionTexture")
        if info is not None:
            self._document.warnings.tally(
                "1 transmission texture counts by its mean", "{n} transmission textures count by their means"
            )
            share *= self._textures.mean_red(info)
        tint = read.base_color if color is None else read.base_color * self._textures.mean_color(color)
        passing = share * float(tint.mean())
        # What does not pass is reflected, or absorbed by the tint.
        reflected = (1.0 - share) / (1.0 - passing) if passing < 1.0 else 0.0
        return replace(
            read,
            base_color=read.base_color * np.float32(reflected),
            alpha_mode="blend",
            opacity=(1.0 if read.is_opaque else read.opacity) * (1.0 - passing),
            alpha_cutoff=0.5,
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
        if material.extension("KHR_materials_diffuse_transmission") is not None:
            warnings.tally(
                "1 material transmits light diffusely; it is drawn opaque",
                "{n} materials transmit light diffusely; they are drawn opaque",
            )
        if material.extension("KHR_materials_unlit") is not None:
            warnings.tally(
                "1 material is unlit, and no other surface is there: it is lit like any other",
                "{n} materials are unlit, and no other surface is there: they are lit like any other",
            )

    def _metalness(self, material: JsonObject, color: JsonObject | None) -> tuple[float, JsonObject | None]:
        """The metallic factor, and the textureInfo that multiplies it; None where the factor says all.

        A texture that is placed otherwise than the base colour's counts by its mean.
        """
        holder = material.object("pbrMetallicRoughness")
        # By the letter, what leaves the whole object out is a white metal: a placeholder, drawn matt.
        if holder is None or any(map(material.extension, _WITHOUT_METAL)):
            return 0.0, None
        factor = holder.number("metallicFactor", 1.0, low=0.0, high=1.0)
        info = holder.object("metallicRoughnessTexture")
        image = None if info is None or factor == 0.0 else self._textures.image(info)
        metalness = None if image is None else self._metal_texels(image)
        if metalness is None:
            image = None
        elif info is not None:
            if metalness.min() == metalness.max():
                factor, info = factor * int(metalness.min()) / 255.0, None
            elif color is not None and not placed_alike(info, color):
                self._document.warnings.tally(
                    "1 metallic texture is placed otherwise than the base colour's; its mean counts",
                    "{n} metallic textures are placed otherwise than the base colours'; their means count",
                )
                factor, info = factor * float(metalness.mean()) / 255.0, None
        if factor > 0.0:
            self._document.warnings.tally(
                "1 material is metallic; its diffuse part is drawn, its reflections are not",
                "{n} materials are metallic; their diffuse parts are drawn, their reflections are not",
            )
        return factor, info if image is not None else None

    def _metal_texels(self, image: JsonObject) -> UInt8[np.ndarray, "height width"] | None:
        """The metalness of an image; None, with a warning, where it is missing or broken.

        Only a base colour's image is worth a refusal: without this one, the surfaces are still those of the
        file, and their factor says how metallic they are.
        """
        if image.where not in self._unreadable:
            try:
                return self._textures.texels(image)[..., 2]
            except SceneFileError as error:
                self._unreadable[image.where] = str(error)
        first = next(iter(self._unreadable.values()))
        self._document.warnings.tally(
            f"1 metallic texture counts as white: {first}",
            f"{{n}} metallic textures count as white; for one, {first}",
        )
        return None
