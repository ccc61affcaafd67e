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
from vpltune.renderer.scene.mitsuba_import.texture_plugins import (
    MEAN_ROWS,
    check_bitmap,
    linear_mean,
    uv_transform,
    within_scale,
)
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


@dataclass(frozen=True, eq=False)
class Surfacing:
    """A material, and the transform of texture coordinates that its texture asks for."""

    material: int
    """Index into the scene's materials."""
    to_uv: Float64[np.ndarray, "3 3"]
    """Affine transform of homogeneous (u, v, 1)."""


@dataclass(frozen=True, eq=False)
class AreaEmission:
    """What the material of an emitting shape emits."""

    radiance: tuple[float, float, float]
    """RGB in W/(m² sr); a factor of the texture, if there is one."""
    texture: int | None
    """Index into the scene's textures."""
    to_uv: Float64[np.ndarray, "3 3"]
    """Affine transform of texture coordinates (u, v, 1) that the texture asks for."""


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
        self._bright: dict[tuple[str, Wrap], tuple[np.ndarray, int]] = {}
        self._glowing: dict[tuple[object, ...], Surfacing] = {}
        # Mitsuba's default for a shape that emits.
        self._black = Plugin("bsdf", "diffuse", "a shape without a material")
        self._black.values["reflectance"] = 0.0
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

    def glowing(self, bsdf: Plugin | None, emission: AreaEmission) -> Surfacing:
        """A material of its own for a shape that emits; black where the BSDF has no diffuse part.

        A mesh has one set of texture coordinates. Where the texture of the radiance lies otherwise than that
        of the BSDF, the latter goes.

        Args:
            bsdf: the plugin; None stands for Mitsuba's default of emitting shapes, which is black.
            emission: of the shape.

        Raises:
            SceneFileError: as `surfacing`.
        """
        plain = self.surfacing(self._black if bsdf is None else bsdf)
        plain = plain or self.surfacing(self._black)
        assert plain is not None
        key = (plain.material, emission.radiance, emission.texture, emission.to_uv.tobytes())
        if key not in self._glowing:
            material, to_uv = self.materials[plain.material], plain.to_uv
            if emission.texture is not None:
                if material.texture is not None and not np.allclose(to_uv, emission.to_uv):
                    self._warnings.add(
                        "an area emitter's texture lies otherwise than that of its material, which is dropped"
                    )
                    material = replace(material, texture=None)
                to_uv = emission.to_uv
            self.materials.append(
                replace(material, emission=emission.radiance, emission_texture=emission.texture)
            )
            self._glowing[key] = Surfacing(len(self.materials) - 1, to_uv)
        return self._glowing[key]

    def mean_color(self, texture: Plugin) -> Float64[np.ndarray, "3"]:
        """The mean of a texture's linear values over all texels.

        Raises:
            SceneFileError: the texture type is unsupported, or its image cannot be read.
        """
        if texture.type == "scale":
            return self.mean_color(within_scale(texture)) * texture.vector("scale", (1.0, 1.0, 1.0))
        if texture.type == "checkerboard":
            return (texture.vector("color0", _COLOR0) + texture.vector("color1", _COLOR1)) / 2.0
        check_bitmap(texture)
        name, is_raw = texture.text("filename"), texture.flag("raw", False)
        if (name, is_raw) not in self._means:
            if name.lower().endswith(".exr"):
                content = self._folder.read(name, texture.where)
                channels = exr_channels(content, f"{texture.where}: {name!r:.80}")
                mean = np.array([channel.mean(dtype=np.float64) for channel in channels])
            else:
                mean = linear_mean(self._texels(texture))
            self._means[name, is_raw] = mean
        return self._means[name, is_raw]

    def emission_texture(
        self, texture: Plugin
    ) -> tuple[Float64[np.ndarray, "3"], int, Float64[np.ndarray, "3 3"]] | None:
        """A bitmap of radiance as a factor, the index of a texture, and the transform of its coordinates.

        Returns:
            None if the texture is no bitmap.

        Raises:
            SceneFileError: the texture type is unsupported, or its image cannot be read.
        """
        factor = np.ones(3)
        while texture.type == "scale":
            factor = factor * texture.vector("scale", (1.0, 1.0, 1.0))
            texture = within_scale(texture)
        if texture.type != "bitmap":
            return None
        if not texture.text("filename").lower().endswith(".exr"):
            return factor, self._bitmap(texture), uv_transform(texture)
        key = (texture.text("filename"), self._wrap(texture))
        if key not in self._bright:
            self._bright[key] = self._eight_bits(texture)
        largest, index = self._bright[key]
        return factor * largest, index, uv_transform(texture)

    def _eight_bits(self, texture: Plugin) -> tuple[Float64[np.ndarray, "3"], int]:
        """The largest value of each channel of an OpenEXR image, and the texture of the shares of it."""
        name = texture.text("filename")
        content = self._folder.read(name, texture.where)
        channels = exr_channels(content, f"{texture.where}: {name!r:.80}")
        height, width = channels[0].shape
        self._images.admit((width, height), len(content), texture.where)
        largest = np.array([float(channel.max()) for channel in channels])
        texels = np.empty((height, width, 3), np.uint8)
        is_lost = False
        for index, channel in enumerate(channels):
            for top in range(0, height, MEAN_ROWS):
                rows = slice(top, top + MEAN_ROWS)
                shares = channel[rows] / np.float32(largest[index] or 1.0)
                texels[rows, :, index] = np.round(255.0 * srgb_from_linear(shares))
                is_lost |= bool(((texels[rows, :, index] == 0) & (shares > 0.0)).any())
        if is_lost:
            self._warnings.add(
                f"the radiance {name!r:.60} spans more than eight bits hold: what is below 0.00015 of its "
                "largest value is dark"
            )
        wrap = self._wrap(texture)
        self.textures.append(Texture(label(name, "texture"), texels, wrap, wrap))
        return largest, len(self.textures) - 1

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
        elif opacity.type != "bitmap" or (
            texture is not None and not np.allclose(uv_transform(opacity), to_uv)
        ):
            self._warnings.add(
                "mask: an opacity that is no bitmap, or placed otherwise than the colour, is ignored"
            )
            return inner
        else:
            # `_texels` holds plain numbers encoded too.
            linear = linear_from_srgb(self._texels(opacity)[..., 0] / 255.0)
            plane, to_uv = np.round(255.0 * linear).astype(np.uint8), uv_transform(opacity)
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
            return self._textured(name, within_scale(texture), factor)
        to_uv = uv_transform(texture)
        if texture.type == "checkerboard":
            return self._add(name, factor, self._checkerboard(texture), to_uv)
        check_bitmap(texture)
        return self._add(name, factor, self._bitmap(texture), to_uv)

    def _bitmap(self, texture: Plugin) -> int:
        """The index of the texture of a bitmap with eight bits."""
        wrap, texels = self._wrap(texture), self._texels(texture)
        key = (id(texels), wrap)
        if key not in self._textured_with:
            self._textured_with[key] = len(self.textures)
            of_file = label(texture.text("filename"), "texture")
            self.textures.append(Texture(of_file, texels, wrap, wrap))
        return self._textured_with[key]

    def _wrap(self, texture: Plugin) -> Wrap:
        if texture.text("filter_type", "bilinear") == "nearest":
            self._warnings.add(
                "textures are filtered bilinearly, although the scene asks for nearest filtering"
            )
        wrap = texture.text("wrap_mode", "repeat")
        if wrap not in _WRAPS:
            raise SceneFileError(
                f"{texture.where}: wrap_mode must be one of {', '.join(_WRAPS)}, got {wrap!r:.40}"
            )
        return _WRAPS[wrap]

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
