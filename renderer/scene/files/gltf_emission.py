"""The emission of glTF materials: emissiveFactor, emissiveTexture and KHR_materials_emissive_strength."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from vpltune.renderer.scene.files.diagnostics import SceneFileError
from vpltune.renderer.scene.files.gltf_document import GltfDocument
from vpltune.renderer.scene.files.gltf_textures import GltfTextures, Layers, placed_alike
from vpltune.renderer.scene.files.json_object import JsonObject, shown
from vpltune.renderer.scene.files.limits import LARGEST_NUMBER, LARGEST_RADIOMETRIC


@dataclass(frozen=True, eq=False)
class Glow:
    """The emission of a material, as `Material` has it."""

    radiance: tuple[float, float, float] = (0.0, 0.0, 0.0)
    texture: int | None = None
    both_ways: bool = False
    placed: JsonObject | None = None
    """The textureInfo of `texture`; None without one."""


class GltfEmission:
    """Reads the emission of materials.

    glTF gives it in candela per square metre. One of these counts as one W/(m² sr), as one candela of a light
    counts as one W/sr.

    Args:
        document: takes warnings.
        textures: reads emissive textures, and collects them.
    """

    def __init__(self, document: GltfDocument, textures: GltfTextures) -> None:
        self._document = document
        self._textures = textures
        self._broken: set[int] = set()

    def of(self, material: JsonObject, placed: JsonObject | None) -> Glow:
        """The emission of a material. One that is unlit has none: its colour is no light.

        Args:
            material: the material object.
            placed: the textureInfo by which the base colour is looked up; None without one. A mesh has one
                set of texture coordinates, so an emissive texture that lies otherwise counts by its mean.

        Raises:
            SceneFileError: a number is negative, or too large.
        """
        if material.extension("KHR_materials_unlit") is not None:
            return Glow()
        factor = material.numbers("emissiveFactor", 3, default=(0.0, 0.0, 0.0))
        if (factor < 0.0).any():
            raise SceneFileError(
                f"{material.at('emissiveFactor')}: must not be negative, got {shown(factor.tolist())}"
            )
        extension = material.extension("KHR_materials_emissive_strength")
        strength = (
            1.0
            if extension is None
            else extension.number("emissiveStrength", 1.0, low=0.0, high=LARGEST_NUMBER)
        )
        radiance = strength * factor
        if radiance.max() > LARGEST_RADIOMETRIC:
            raise SceneFileError(
                f"{material.at('emissiveFactor')}: the radiance must be at most {LARGEST_RADIOMETRIC:g}, "
                f"got {radiance.max():g}"
            )
        if not radiance.any():
            return Glow()
        both_ways = material.boolean("doubleSided", False)
        info = material.object("emissiveTexture")
        texture, mean = (None, np.ones(3)) if info is None else self._texture(info, placed)
        red, green, blue = (radiance * mean).tolist()
        return Glow((red, green, blue), texture, both_ways, None if texture is None else info)

    def _texture(
        self, info: JsonObject, placed: JsonObject | None
    ) -> tuple[int | None, Float64[np.ndarray, "3"]]:
        """The texture of a textureInfo, or its mean in place of it."""
        number, white = info.integer("index", -1, low=-1), np.ones(3)
        if number in self._broken:
            return None, white
        try:
            if placed is None or placed_alike(info, placed):
                return self._textures.of(Layers(info)), white
            mean = self._textures.mean_color(info)
        except SceneFileError as error:
            # An image is not tried again for each of many materials, and only the first has its cause told.
            if not self._broken:
                self._document.warnings.add(f"{error}; the emissive factor alone is used")
            else:
                self._document.warnings.tally(
                    "1 more emissive texture cannot be read", "{n} more emissive textures cannot be read"
                )
            self._broken.add(number)
            return None, white
        self._document.warnings.tally(
            "1 emissive texture is placed otherwise than the base colour's; its mean counts",
            "{n} emissive textures are placed otherwise than the base colours'; their means count",
        )
        return None, mean
