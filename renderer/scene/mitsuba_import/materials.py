"""The diffuse part of Mitsuba's materials: what a surface reflects evenly in all directions."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, UInt8

from vpltune.renderer.files.srgb import srgb_from_linear
from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings, label
from vpltune.renderer.scene.files.image_texels import MTL_FORMATS, ImageDecoder
from vpltune.renderer.scene.files.scene_folder import SceneFolder
from vpltune.renderer.scene.mitsuba_import.plugin_tree import Plugin
from vpltune.renderer.scene.scene import Material, Texture, Wrap

_WRAPS: dict[str, Wrap] = {"repeat": "repeat", "mirror": "mirrored_repeat", "clamp": "clamp_to_edge"}
_WRAPPERS = ("twosided", "mask", "bumpmap", "normalmap", "bump", "coating", "roughcoating")
_DIFFUSE_NAMES = {
    "diffuse": "reflectance",
    "roughdiffuse": "reflectance",
    "plastic": "diffuse_reflectance",
    "roughplastic": "diffuse_reflectance",
    "phong": "diffuse_reflectance",
    "ward": "diffuse_reflectance",
    "principled": "base_color",
    "principledthin": "base_color",
}
_GLASS = ("dielectric", "thindielectric", "roughdielectric", "null")
# Reflectance at normal incidence, linear Rec. 709.
_METALS = {
    "none": (1.0, 1.0, 1.0),
    "Ag": (0.96, 0.95, 0.92),
    "Al": (0.91, 0.92, 0.92),
    "Au": (0.94, 0.78, 0.37),
    "Cr": (0.55, 0.56, 0.55),
    "Cu": (0.93, 0.72, 0.50),
}
_CHECKER_TEXELS = 64


@dataclass(frozen=True, eq=False)
class Surfacing:
    """A material of the scene, and what its texture asks of the mesh's coordinates."""

    material: int
    to_uv: Float64[np.ndarray, "3 3"]


class MaterialReader:
    """Collects materials and textures, each once."""

    def __init__(self, folder: SceneFolder, warnings: Warnings):
        self.materials: list[Material] = []
        self.textures: list[Texture] = []
        self._folder = folder
        self._warnings = warnings
        self._images = ImageDecoder(MTL_FORMATS)
        self._decoded: dict[tuple[str, bool], UInt8[np.ndarray, "height width 3"]] = {}
        self._made: dict[int, Surfacing | None] = {}
        self._kept: list[Plugin] = []

    def surfacing(self, bsdf: Plugin | None) -> Surfacing | None:
        """What stands for a material; None where its surface must be left out.

        Raises:
            SceneFileError: the type is not known here, or a texture cannot be read.
        """
        if bsdf is None:
            bsdf = Plugin("bsdf", "diffuse", "a shape without a material")
        if id(bsdf) not in self._made:
            self._kept.append(bsdf)  # no other may take its id
            self._made[id(bsdf)] = self._diffuse_part(bsdf)
        return self._made[id(bsdf)]

    def _diffuse_part(self, bsdf: Plugin) -> Surfacing | None:
        name = bsdf.type
        if bsdf.type in _WRAPPERS:
            return self._inner(bsdf)
        if bsdf.type in _GLASS:
            self._warnings.tally(
                "1 material is glass or empty: its surfaces are left out",
                "{n} materials are glass or empty: their surfaces are left out",
            )
            return None
        if bsdf.type in ("conductor", "roughconductor"):
            self._warnings.tally(
                "1 metal is drawn matt, with its reflectance at normal incidence",
                "{n} metals are drawn matt, with their reflectance at normal incidence",
            )
            return self._add(name, self._metal(bsdf), None)
        if bsdf.type in ("blendbsdf", "mixturebsdf"):
            return self._blend(bsdf)
        if bsdf.type not in _DIFFUSE_NAMES:
            raise SceneFileError(f"{bsdf.where}: materials of this type are not read")
        if bsdf.type not in ("diffuse", "roughdiffuse"):
            self._warnings.tally(
                "1 material has gloss, which is left out: its diffuse part stays",
                "{n} materials have gloss, which is left out: their diffuse parts stay",
            )
        key = _DIFFUSE_NAMES[bsdf.type]
        texture = bsdf.child(key)
        if texture is None or texture.kind != "texture":
            return self._add(name, bsdf.vector(key, (0.5, 0.5, 0.5)), None)
        return self._textured(name, texture, np.ones(3))

    def _inner(self, bsdf: Plugin) -> Surfacing | None:
        inner = bsdf.of_kind("bsdf")
        if not inner:
            raise SceneFileError(f"{bsdf.where}: has no material within")
        if bsdf.type == "mask":
            self._warnings.tally(
                "1 cut-out material is drawn whole: its opacity is left out",
                "{n} cut-out materials are drawn whole: their opacity is left out",
            )
        elif bsdf.type != "twosided":
            self._warnings.add(f"{bsdf.type}: bumps and coats are left out; the material beneath stays")
        return self.surfacing(inner[0])

    def _metal(self, bsdf: Plugin) -> Float64[np.ndarray, "3"]:
        tint = bsdf.vector("specular_reflectance", (1.0, 1.0, 1.0))
        if "eta" in bsdf.values or "k" in bsdf.values:
            eta, k = bsdf.vector("eta", (0.0, 0.0, 0.0)), bsdf.vector("k", (1.0, 1.0, 1.0))
            # Fresnel at normal incidence, against air.
            return tint * ((eta - 1.0) ** 2 + k**2) / ((eta + 1.0) ** 2 + k**2)
        metal = bsdf.text("material", "none")
        if metal not in _METALS:
            self._warnings.add(
                f"metal {label(metal, '?')}: its colour is not known here, grey of 0.6 is taken"
            )
        return tint * np.array(_METALS.get(metal, (0.6, 0.6, 0.6)))

    def _blend(self, bsdf: Plugin) -> Surfacing | None:
        inner = bsdf.of_kind("bsdf")
        if not inner:
            raise SceneFileError(f"{bsdf.where}: has no material within")
        self._warnings.add(f"{bsdf.type}: of several materials, the heaviest stands for all")
        heavier = 1 if len(inner) > 1 and bsdf.number("weight", 0.5) > 0.5 else 0
        return self.surfacing(inner[heavier])

    def _textured(self, name: str, texture: Plugin, factor: Float64[np.ndarray, "3"]) -> Surfacing:
        if texture.type == "scale":
            within = texture.of_kind("texture")
            if not within:
                raise SceneFileError(f"{texture.where}: has no texture within")
            return self._textured(name, within[0], factor * texture.vector("scale", (1.0, 1.0, 1.0)))
        to_uv = _to_uv(texture)
        if texture.type == "checkerboard":
            return self._add(name, factor, self._checkerboard(texture), to_uv)
        if texture.type != "bitmap":
            raise SceneFileError(
                f"{texture.where}: textures of this type are not read; bitmap and checkerboard are"
            )
        if texture.text("filter_type", "bilinear") == "nearest":
            self._warnings.add("textures are looked up smoothly, where the scene asks for the nearest texel")
        wrap = texture.text("wrap_mode", "repeat")
        if wrap not in _WRAPS:
            raise SceneFileError(
                f"{texture.where}: wrap_mode must be one of {', '.join(_WRAPS)}, got {wrap!r:.40}"
            )
        texels = self._texels(texture)
        self.textures.append(
            Texture(label(texture.text("filename"), "texture"), texels, _WRAPS[wrap], _WRAPS[wrap])
        )
        return self._add(name, factor, len(self.textures) - 1, to_uv)

    def _texels(self, texture: Plugin) -> UInt8[np.ndarray, "height width 3"]:
        name, is_raw = texture.text("filename"), texture.flag("raw", False)
        if (name, is_raw) not in self._decoded:
            content = self._folder.read(name, texture.where)
            texels = self._images.decode(content, f"{texture.where}: {name!r:.80}")
            if is_raw:
                texels = np.round(255.0 * srgb_from_linear(texels / 255.0)).astype(np.uint8)
            self._decoded[name, is_raw] = texels
        return self._decoded[name, is_raw]

    def _checkerboard(self, texture: Plugin) -> int:
        dark = texture.vector("color0", (0.4, 0.4, 0.4))
        bright = texture.vector("color1", (0.2, 0.2, 0.2))
        half = np.arange(_CHECKER_TEXELS) < _CHECKER_TEXELS // 2
        fields = np.where((half[:, None] == half[None, :])[..., None], dark, bright)
        texels = np.round(255.0 * srgb_from_linear(np.clip(fields, 0.0, 1.0))).astype(np.uint8)
        self.textures.append(Texture("checkerboard", texels))
        return len(self.textures) - 1

    def _add(
        self,
        name: str,
        base_color: Float64[np.ndarray, "3"],
        texture: int | None,
        to_uv: Float64[np.ndarray, "3 3"] | None = None,
    ) -> Surfacing:
        if (base_color > 1.0).any():
            self._warnings.add("reflectances above 1 are drawn as 1")
        color = np.clip(base_color, 0.0, 1.0).astype(np.float32)
        self.materials.append(Material(f"{name} {len(self.materials)}", color, texture))
        return Surfacing(len(self.materials) - 1, np.eye(3) if to_uv is None else to_uv)


def _to_uv(texture: Plugin) -> Float64[np.ndarray, "3 3"]:
    """The affine map of texture coordinates: a transform, or the scales and offsets of version 0.x."""
    if "to_uv" in texture.values:
        matrix = texture.to_world("to_uv")
        return matrix[np.ix_((0, 1, 3), (0, 1, 3))]
    scale = texture.number("uvscale", 1.0)
    result = np.diag([texture.number("uscale", scale), texture.number("vscale", scale), 1.0])
    result[:2, 2] = texture.number("uoffset", 0.0), texture.number("voffset", 0.0)
    return result
