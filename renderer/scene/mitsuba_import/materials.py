"""The diffuse part of Mitsuba's materials."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, UInt8

from vpltune.renderer.files.srgb import linear_from_srgb, srgb_from_linear
from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings, label
from vpltune.renderer.scene.files.exr_pixels import exr_channels
from vpltune.renderer.scene.files.image_texels import MTL_FORMATS, ImageDecoder
from vpltune.renderer.scene.files.opacity import say_blended, without_idle_alpha
from vpltune.renderer.scene.files.scene_folder import SceneFolder
from vpltune.renderer.scene.files.texel_products import of_size
from vpltune.renderer.scene.mitsuba_import.plugin_tree import Plugin
from vpltune.renderer.scene.scene import Material, Texture, Wrap

# Mitsuba's wrap modes.
_WRAPS: dict[str, Wrap] = {"repeat": "repeat", "mirror": "mirrored_repeat", "clamp": "clamp_to_edge"}
# Materials that modify the material inside them, which is used in their place.
_WRAPPERS = ("twosided", "mask", "bumpmap", "normalmap", "bump", "coating", "roughcoating")
# The parameter of each material type that holds its diffuse reflectance.
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
# Materials without a diffuse part; their surfaces are removed.
_GLASS = ("dielectric", "thindielectric", "roughdielectric", "null")
# A choice: side of a checkerboard image in texels. Bilinear filtering blurs its edges by one texel.
_CHECKER_TEXELS = 64
# Mitsuba's defaults for its fields.
_COLOR0, _COLOR1 = (0.4, 0.4, 0.4), (0.2, 0.2, 0.2)
# A choice: rows of an image averaged at a time, which are a few MiB.
_MEAN_ROWS = 64


@dataclass(frozen=True, eq=False)
class Surfacing:
    """A material, and the transform of texture coordinates that its texture asks for."""

    material: int
    """Index into the scene's materials."""
    to_uv: Float64[np.ndarray, "3 3"]
    """Affine transform of homogeneous (u, v, 1)."""


class MaterialReader:
    """Converts materials and textures, each once, and collects them in `materials` and `textures`."""

    def __init__(self, folder: SceneFolder, warnings: Warnings):
        self.materials: list[Material] = []
        self.textures: list[Texture] = []
        self._folder = folder
        self._warnings = warnings
        self._images = ImageDecoder(MTL_FORMATS)
        self._decoded: dict[tuple[str, bool], UInt8[np.ndarray, "height width 3"]] = {}
        self._means: dict[tuple[str, bool], np.ndarray] = {}
        self._textured_with: dict[tuple[int, Wrap], int] = {}
        self._default = Plugin("bsdf", "diffuse", "a shape without a material")
        self._made: dict[int, Surfacing | None] = {}
        self._kept: list[Plugin] = []

    def surfacing(self, bsdf: Plugin | None) -> Surfacing | None:
        """The diffuse material for a BSDF; None if surfaces with it must be removed.

        Args:
            bsdf: the plugin; None stands for Mitsuba's default, a grey of 0.5.

        Raises:
            SceneFileError: the material or texture type is unsupported, or a texture cannot be read.
        """
        if bsdf is None:
            bsdf = self._default
        if id(bsdf) not in self._made:
            self._kept.append(bsdf)  # keep the object alive, so that its id stays unique
            self._made[id(bsdf)] = self._diffuse_part(bsdf)
        return self._made[id(bsdf)]

    def mean_color(self, texture: Plugin) -> Float64[np.ndarray, "3"]:
        """The mean of a texture's linear values over all texels.

        Raises:
            SceneFileError: the texture type is unsupported, or its image cannot be read.
        """
        if texture.type == "scale":
            return self.mean_color(_scaled(texture)) * texture.vector("scale", (1.0, 1.0, 1.0))
        if texture.type == "checkerboard":
            return (texture.vector("color0", _COLOR0) + texture.vector("color1", _COLOR1)) / 2.0
        _check_bitmap(texture)
        name, is_raw = texture.text("filename"), texture.flag("raw", False)
        if (name, is_raw) not in self._means:
            if name.lower().endswith(".exr"):
                content = self._folder.read(name, texture.where)
                channels = exr_channels(content, f"{texture.where}: {name!r:.80}")
                mean = np.array([channel.mean(dtype=np.float64) for channel in channels])
            else:
                mean = _linear_mean(self._texels(texture))
            self._means[name, is_raw] = mean
        return self._means[name, is_raw]

    def _diffuse_part(self, bsdf: Plugin) -> Surfacing | None:
        name = bsdf.type
        if bsdf.type in _WRAPPERS:
            return self._inner(bsdf)
        if bsdf.type in _GLASS:
            self._warnings.tally(
                "1 material is glass or empty: its surfaces are removed",
                "{n} materials are glass or empty: their surfaces are removed",
            )
            return None
        if bsdf.type in ("conductor", "roughconductor"):
            self._warnings.tally(
                "1 metal is drawn black: its reflections are not drawn",
                "{n} metals are drawn black: their reflections are not drawn",
            )
            return self._add(name, np.zeros(3), None)
        if bsdf.type in ("blendbsdf", "mixturebsdf"):
            return self._blend(bsdf)
        if bsdf.type not in _DIFFUSE_NAMES:
            raise SceneFileError(f"{bsdf.where}: unsupported material type")
        matt = 1.0 - self._metallic(bsdf)
        if bsdf.type not in ("diffuse", "roughdiffuse"):
            self._warnings.tally(
                "1 material has gloss, which is ignored; its diffuse part is kept",
                "{n} materials have gloss, which is ignored; their diffuse parts are kept",
            )
        key = _DIFFUSE_NAMES[bsdf.type]
        texture = bsdf.child(key)
        if texture is None or texture.kind != "texture":
            return self._add(name, matt * bsdf.vector(key, (0.5, 0.5, 0.5)), None)
        return self._textured(name, texture, np.full(3, matt))

    def _inner(self, bsdf: Plugin) -> Surfacing | None:
        inner = bsdf.of_kind("bsdf")
        if not inner:
            raise SceneFileError(f"{bsdf.where}: must contain a material")
        if bsdf.type == "mask":
            return self._masked(bsdf, self.surfacing(inner[0]))
        if bsdf.type != "twosided":
            self._warnings.add(f"{bsdf.type}: bumps and coatings are ignored; the material beneath is used")
        return self.surfacing(inner[0])

    def _masked(self, mask: Plugin, inner: Surfacing | None) -> Surfacing | None:
        """A material that stops the share `opacity` of the light, a number or the image of a bitmap."""
        if inner is None:
            return None
        material = self.materials[inner.material]
        texture = None if material.texture is None else self.textures[material.texture]
        number, to_uv, index = 1.0, inner.to_uv, material.texture
        opacity = mask.child("opacity")
        if opacity is None or opacity.kind != "texture":
            number = min(max(float(mask.vector("opacity", (0.5, 0.5, 0.5)).mean()), 0.0), 1.0)
        elif opacity.type != "bitmap" or (texture is not None and not np.allclose(_to_uv(opacity), to_uv)):
            self._warnings.add(
                "mask: an opacity that is no bitmap, or placed otherwise than the colour, is ignored"
            )
            return inner
        else:
            # `_texels` holds plain numbers encoded too.
            linear = linear_from_srgb(self._texels(opacity)[..., 0] / 255.0)
            plane, to_uv = np.round(255.0 * linear).astype(np.uint8), _to_uv(opacity)
            texture = _with_opacity(texture, plane, self._images, mask.where)
            index = len(self.textures)
            self.textures.append(texture)
        masked = replace(material, texture=index, alpha_mode="blend", opacity=number)
        masked = without_idle_alpha(masked, texture)
        say_blended(masked, self._warnings)
        self.materials.append(masked)
        return Surfacing(len(self.materials) - 1, to_uv)

    def _metallic(self, bsdf: Plugin) -> float:
        """Metalness in [0, 1] of a principled material; 0 for all others."""
        if bsdf.type != "principled":
            return 0.0
        if bsdf.child("metallic") is not None:
            self._warnings.add("principled: a texture of metalness is ignored; the material is drawn matt")
            return 0.0
        metallic = min(max(bsdf.number("metallic", 0.0), 0.0), 1.0)
        if metallic > 0.0:
            self._warnings.tally(
                "1 material is metallic; its diffuse part is drawn, its reflections are not",
                "{n} materials are metallic; their diffuse parts are drawn, their reflections are not",
            )
        return metallic

    def _blend(self, bsdf: Plugin) -> Surfacing | None:
        inner = bsdf.of_kind("bsdf")
        if not inner:
            raise SceneFileError(f"{bsdf.where}: must contain a material")
        self._warnings.add(f"{bsdf.type}: only the material with the largest weight is used")
        heavier = 1 if len(inner) > 1 and bsdf.number("weight", 0.5) > 0.5 else 0
        return self.surfacing(inner[heavier])

    def _textured(self, name: str, texture: Plugin, factor: Float64[np.ndarray, "3"]) -> Surfacing:
        if texture.type == "scale":
            factor = factor * texture.vector("scale", (1.0, 1.0, 1.0))
            return self._textured(name, _scaled(texture), factor)
        to_uv = _to_uv(texture)
        if texture.type == "checkerboard":
            return self._add(name, factor, self._checkerboard(texture), to_uv)
        _check_bitmap(texture)
        if texture.text("filter_type", "bilinear") == "nearest":
            self._warnings.add(
                "textures are filtered bilinearly, although the scene asks for nearest filtering"
            )
        wrap = texture.text("wrap_mode", "repeat")
        if wrap not in _WRAPS:
            raise SceneFileError(
                f"{texture.where}: wrap_mode must be one of {', '.join(_WRAPS)}, got {wrap!r:.40}"
            )
        texels = self._texels(texture)
        key = (id(texels), _WRAPS[wrap])
        if key not in self._textured_with:
            self._textured_with[key] = len(self.textures)
            of_file = label(texture.text("filename"), "texture")
            self.textures.append(Texture(of_file, texels, _WRAPS[wrap], _WRAPS[wrap]))
        return self._add(name, factor, self._textured_with[key], to_uv)

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
        dark, bright = texture.vector("color0", _COLOR0), texture.vector("color1", _COLOR1)
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
            self._warnings.add("reflectances above 1 are clamped to 1")
        color = np.clip(base_color, 0.0, 1.0).astype(np.float32)
        self.materials.append(Material(f"{name} {len(self.materials)}", color, texture))
        return Surfacing(len(self.materials) - 1, np.eye(3) if to_uv is None else to_uv)


def _with_opacity(
    texture: Texture | None, plane: UInt8[np.ndarray, "height width"], images: ImageDecoder, where: str
) -> Texture:
    """The texture, or white, with an opacity; both in the larger size of the two."""
    sizes = [plane.shape] if texture is None else [plane.shape, texture.texels_srgb.shape[:2]]
    height, width = np.max(sizes, axis=0).tolist()
    images.spend(width * height, f"its texels of {width} × {height}", where)
    opacity = of_size(plane, width, height)
    if texture is None:
        return Texture("mask", np.full((height, width, 3), 255, np.uint8), opacity=opacity)
    return replace(texture, texels_srgb=of_size(texture.texels_srgb, width, height), opacity=opacity)


def texture_name(texture: Plugin) -> str:
    """What a texture is called in messages: its file, or else its type."""
    if texture.type == "scale":
        return texture_name(_scaled(texture))
    return repr(label(texture.text("filename", texture.type), "?"))


def _scaled(texture: Plugin) -> Plugin:
    """The texture within one of the type 'scale'."""
    within = texture.of_kind("texture")
    if not within:
        raise SceneFileError(f"{texture.where}: must contain a texture")
    return within[0]


def _check_bitmap(texture: Plugin) -> None:
    if texture.type != "bitmap":
        raise SceneFileError(f"{texture.where}: unsupported texture type; must be bitmap or checkerboard")


def _linear_mean(texels_srgb: UInt8[np.ndarray, "height width 3"]) -> Float64[np.ndarray, "3"]:
    linear = linear_from_srgb(np.arange(256) / 255.0)
    height, width, _ = texels_srgb.shape
    total = np.zeros(3)
    for top in range(0, height, _MEAN_ROWS):
        strip = texels_srgb[top : top + _MEAN_ROWS].reshape(-1, 3)
        total += [np.bincount(channel, minlength=256) @ linear for channel in strip.T]
    return total / (height * width)


def _to_uv(texture: Plugin) -> Float64[np.ndarray, "3 3"]:
    """The affine transform of texture coordinates: a `to_uv`, or the scales and offsets of version 0.x."""
    if "to_uv" in texture.values:
        matrix = texture.to_world("to_uv")
        return matrix[np.ix_((0, 1, 3), (0, 1, 3))]
    scale = texture.number("uvscale", 1.0)
    result = np.diag([texture.number("uscale", scale), texture.number("vscale", scale), 1.0])
    result[:2, 2] = texture.number("uoffset", 0.0), texture.number("voffset", 0.0)
    return result
