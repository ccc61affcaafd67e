"""Wavefront MTL: diffuse colours, emission and maps. A diffuse material has no use for the rest."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from jaxtyping import Float32, UInt8

from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings, label, one_line
from vpltune.renderer.scene.files.image_texels import MTL_FORMATS, ImageDecoder
from vpltune.renderer.scene.files.limits import LARGEST_RADIOMETRIC
from vpltune.renderer.scene.files.opacity import say_blended, without_idle_alpha
from vpltune.renderer.scene.files.plain_numbers import plain_number
from vpltune.renderer.scene.files.scene_folder import SceneFolder
from vpltune.renderer.scene.files.texel_products import of_size
from vpltune.renderer.scene.files.text_lines import first_word, text_lines, without_remark
from vpltune.renderer.scene.scene import Material, Texture, Wrap

_Image = TypeVar("_Image")

# Statements that end in a name.
_NAMING = (b"newmtl", b"map_kd", b"map_ke", b"map_d")
# Options of map_Kd and how many words follow each. The options in `_TRANSFORMS` take one to three numbers.
_MAP_OPTIONS = {
    "-blendu": 1,
    "-blendv": 1,
    "-boost": 1,
    "-mm": 2,
    "-texres": 1,
    "-clamp": 1,
    "-imfchan": 1,
    "-bm": 1,
    "-cc": 1,
}
_TRANSFORMS = ("-o", "-s", "-t")
MOST_LIBRARIES = 1000
"""A choice: names of material libraries that are looked for. A file has one; a lookup takes about 20 µs."""
# A choice: materials that libraries define. Each takes about 300 bytes.
_MOST_DEFINITIONS = 100_000


@dataclass(eq=False)
class _Definition:
    diffuse: Float32[np.ndarray, "3"] | None = None
    """None where no Kd says it: white."""
    map_path: str = ""
    wrap: Wrap = "repeat"
    opacity: float | None = None
    """As `d` says it, or else 1 − `Tr`. None where neither does."""
    metallic: float = 0.0
    """As `Pm` says it, in [0, 1]."""
    opacity_path: str = ""
    emission: tuple[float, float, float] | None = None
    """As `Ke` says it, in W/(m² sr). None where it does not."""
    emission_path: str = ""
    emission_wrap: Wrap = "repeat"


@dataclass(frozen=True)
class MapStatement:
    """What a `map_Kd` statement says."""

    path: str
    """The rest of the line after the options, blanks included."""
    clamps: bool
    ignored: tuple[str, ...]
    """Options that move or scale the image."""


def map_statement(rest: str) -> MapStatement:
    """Options and path of a map statement.

    Args:
        rest: the line without its keyword.
    """
    words = rest.split()
    at, clamps, ignored = 0, False, []
    while at < len(words) and words[at].startswith("-") and at + 1 < len(words):
        option = words[at]
        clamps |= option == "-clamp" and words[at + 1] == "on"
        if option in _TRANSFORMS:
            ignored.append(option)
            at += 1
            while at < len(words) - 1 and _is_number(words[at]):
                at += 1
        else:
            at += 1 + _MAP_OPTIONS.get(option, 0)
    path = rest.split(None, at)[at] if at < len(words) else ""
    return MapStatement(path.strip(), clamps, tuple(dict.fromkeys(ignored)))


def mtl_statements(content: bytes, where: str) -> Iterator[tuple[int, str, str]]:
    """Line number, keyword and rest of each statement of a material library, without comments.

    Args:
        content: of the library.
        where: its name, for messages.

    Raises:
        SceneFileError: the content is no text in an encoding that keeps ASCII, or a line is too long.
    """
    for number, line in text_lines(content, where):
        keyword, rest = first_word(without_remark(line))
        if keyword.lower() not in _NAMING:
            rest = rest.partition("#")[0].strip()
        if keyword:
            yield number, keyword.decode("utf-8", "replace"), rest


class MtlMaterials:
    """The materials of an OBJ file. Libraries define them; `add` creates them when they are used."""

    def __init__(self, folder: SceneFolder, warnings: Warnings) -> None:
        self._folder = folder
        self._warnings = warnings
        self._decoder = ImageDecoder(MTL_FORMATS)
        self._definitions: dict[str, _Definition] = {}
        self._texture_indices: dict[tuple[str, str, Wrap], int | None] = {}
        self._emission_textures: dict[tuple[str, Wrap], int | None] = {}
        self._missing_maps: list[str] = []
        self._dark_maps = 0
        self._libraries: dict[str, bool] = {}
        self.materials: list[Material] = []
        self.textures: list[Texture] = []

    def read_library(self, names: str) -> None:
        """Read the libraries of an `mtllib` line: one file whose name may have spaces, or several files.

        A library that cannot be read adds a warning.

        Raises:
            SceneFileError: a library breaks a rule, or too many are named.
        """
        if self._read_once(names):
            return
        for name in names.split():
            if not self._read_once(name):
                self._warnings.add(f"material library {name!r:.80} cannot be read; white is used")

    def add(self, name: str) -> int:
        """Create a material, white if no library defines it, and return its index in `materials`.

        Raises:
            SceneFileError: the material's map exists but is a broken image.
        """
        definition = self._definitions.get(name)
        if definition is None and name:
            self._warnings.tally(
                "1 material is not defined in any library; white is used",
                "{n} materials are not defined in any library; white is used",
            )
        definition = definition or _Definition()
        texture = self._texture(definition)
        diffuse = np.ones(3, np.float32) if definition.diffuse is None else definition.diffuse
        if texture is not None and not diffuse.any():
            self._warnings.tally(
                "1 material is black: its Kd 0 0 0 multiplies its map_Kd",
                "{n} materials are black: their Kd 0 0 0 multiplies their map_Kd",
            )
        if definition.metallic > 0.0:
            self._warnings.tally(
                "1 material is metallic; its diffuse part is drawn, its reflections are not",
                "{n} materials are metallic; their diffuse parts are drawn, their reflections are not",
            )
            diffuse = diffuse * np.float32(1.0 - definition.metallic)
        opacity = 1.0 if definition.opacity is None else min(max(definition.opacity, 0.0), 1.0)
        material = Material(label(name, "default"), diffuse, texture, "blend", opacity)
        material = without_idle_alpha(material, None if texture is None else self.textures[texture])
        say_blended(material, self._warnings)
        material = self._glowing(material, definition)
        self.materials.append(material)
        return len(self.materials) - 1

    def _glowing(self, material: Material, definition: _Definition) -> Material:
        """The material with its emission. MTL knows no front, so it emits both ways."""
        # A map without Ke: the programs that write one mean it to shine.
        emission = definition.emission or ((1.0, 1.0, 1.0) if definition.emission_path else (0.0, 0.0, 0.0))
        if not any(emission):
            if definition.emission_path:
                self._warnings.tally(
                    "1 material is dark: its Ke 0 0 0 multiplies its map_Ke",
                    "{n} materials are dark: their Ke 0 0 0 multiplies their map_Ke",
                )
            return material
        return replace(
            material,
            emission=emission,
            emission_texture=self._emission_texture(definition),
            emits_both_ways=True,
        )

    def _emission_texture(self, definition: _Definition) -> int | None:
        if not definition.emission_path:
            return None
        key = (definition.emission_path, definition.emission_wrap)
        if key not in self._emission_textures:
            self._emission_textures[key] = self._read_emission_texture(definition)
        return self._emission_textures[key]

    def _read_emission_texture(self, definition: _Definition) -> int | None:
        path, wrap = definition.emission_path.replace("\\", "/"), definition.emission_wrap
        try:
            texels = self._decoder.decode(self._folder.read(path, "map_Ke"), f"map_Ke {path!r:.80}")
        except SceneFileError as error:
            # Only the first has its cause told.
            if not self._dark_maps:
                self._warnings.add(f"{error}; Ke alone is used")
            else:
                self._warnings.tally("1 more map_Ke cannot be read", "{n} more map_Ke cannot be read")
            self._dark_maps += 1
            return None
        self.textures.append(Texture(label(path, "map_Ke"), texels, wrap, wrap))
        return len(self.textures) - 1

    def say_what_is_missing(self) -> None:
        """Add one warning for all maps that could not be read."""
        if self._missing_maps:
            self._warnings.add(
                f"{len(self._missing_maps)} texture{'s' * (len(self._missing_maps) > 1)} missing "
                f"({one_line(self._missing_maps[0], 80)!r}{', …' * (len(self._missing_maps) > 1)}); "
                "Kd alone is used, or white without it"
            )

    def _texture(self, definition: _Definition) -> int | None:
        if not definition.map_path and not definition.opacity_path:
            return None
        key = (definition.map_path, definition.opacity_path, definition.wrap)
        if key not in self._texture_indices:
            self._texture_indices[key] = self._read_texture(definition)
        return self._texture_indices[key]

    def _read_texture(self, definition: _Definition) -> int | None:
        wrap = definition.wrap
        texels = self._image(definition.map_path, "map_Kd", self._decoder.decode)
        opacity = self._image(definition.opacity_path, "map_d", self._opacity)
        if texels is None and opacity is None:
            return None
        if opacity is not None:
            sizes = [opacity.shape] if texels is None else [opacity.shape, texels.shape[:2]]
            height, width = np.max(sizes, axis=0).tolist()
            where = f"map_d {definition.opacity_path!r:.80}"
            self._decoder.spend(width * height, f"its texels of {width} × {height}", where)
            white = np.full((height, width, 3), 255, np.uint8)
            texels = white if texels is None else of_size(texels, width, height)
            opacity = of_size(opacity, width, height)
        assert texels is not None
        name = label(definition.map_path or definition.opacity_path, "map_Kd")
        self.textures.append(Texture(name.replace("\\", "/"), texels, wrap, wrap, opacity))
        return len(self.textures) - 1

    def _image(self, named: str, keyword: str, decode: Callable[[bytes, str], _Image]) -> _Image | None:
        """An image of the scene's folder; None, to be said later, where it cannot be read."""
        if not named:
            return None
        path = named.replace("\\", "/")
        try:
            content = self._folder.read(path, keyword)
        except SceneFileError:
            self._missing_maps.append(named)
            return None
        return decode(content, f"{keyword} {path!r:.80}")

    def _opacity(self, content: bytes, where: str) -> UInt8[np.ndarray, "height width"]:
        """The alpha of an image that has one, else its brightness."""
        alpha = self._decoder.opacity(content, where)
        return self._decoder.decode(content, where)[..., 0] if alpha is None else alpha

    def _read_once(self, name: str) -> bool:
        """Whether a library can be read. It is read where it is first named."""
        if name not in self._libraries:
            if len(self._libraries) == MOST_LIBRARIES:
                raise SceneFileError(f"mtllib: must name at most {MOST_LIBRARIES:,} libraries, got more")
            self._libraries[name] = self._read_one(name)
        return self._libraries[name]

    def _read_one(self, name: str) -> bool:
        try:
            content = self._folder.read(name.replace("\\", "/"), "mtllib")
        except SceneFileError:
            return False
        definition: _Definition | None = None
        for number, keyword, rest in mtl_statements(content, f"{name!r:.80}"):
            if keyword == "newmtl":
                definition = self._definitions.setdefault(rest, _Definition())
                if len(self._definitions) > _MOST_DEFINITIONS:
                    raise SceneFileError(f"{name!r:.80}: must define at most {_MOST_DEFINITIONS:,} materials")
            elif definition is not None:
                self._read_statement(definition, keyword, rest, f"{name!r:.80} line {number}")
        return True

    def _read_statement(self, definition: _Definition, keyword: str, rest: str, where: str) -> None:
        if keyword == "Kd":
            definition.diffuse = self._albedo(self._color(rest, where))
        elif keyword.lower() == "map_kd":
            said = map_statement(rest)
            definition.map_path = said.path
            definition.wrap = "clamp_to_edge" if said.clamps else "repeat"
            for option in said.ignored:
                self._warnings.add(f"map_Kd option {option} is ignored")
        elif keyword == "Ke":
            definition.emission = _radiance(self._color(rest, where), where)
        elif keyword.lower() == "map_ke":
            said = map_statement(rest)
            definition.emission_path = said.path
            definition.emission_wrap = "clamp_to_edge" if said.clamps else "repeat"
            for option in said.ignored:
                self._warnings.add(f"map_Ke option {option} is ignored")
        elif keyword == "d":
            definition.opacity = _leading_number(rest.removeprefix("-halo"), 1.0)
        elif keyword == "Tr" and definition.opacity is None:
            definition.opacity = 1.0 - _leading_number(rest, 0.0)
        elif keyword == "Pm":
            definition.metallic = min(max(_leading_number(rest, 0.0), 0.0), 1.0)
        elif keyword == "map_d":
            definition.opacity_path = map_statement(rest).path
        elif keyword == "map_Tr":
            self._warnings.tally(
                "1 material has a map_Tr, which is ignored", "{n} materials have a map_Tr, which is ignored"
            )

    def _color(self, rest: str, where: str) -> Float32[np.ndarray, "3"]:
        words = rest.split()
        if words and words[0] in ("spectral", "xyz"):
            self._warnings.add(f"colours given as {words[0]} are not supported; white is used")
            return np.ones(3, np.float32)
        try:
            numbers = [plain_number(word) for word in words[:3]]
            color = np.array(numbers * (3 if len(words) == 1 else 1), np.float32)
        except ValueError:
            color = np.empty(0, np.float32)
        if color.shape != (3,) or not np.isfinite(color).all():
            raise SceneFileError(f"{where}: a colour must be 3 finite numbers, got {rest!r:.60}")
        return color

    def _albedo(self, color: Float32[np.ndarray, "3"]) -> Float32[np.ndarray, "3"]:
        if (color < 0.0).any() or (color > 1.0).any():
            self._warnings.tally(
                "1 material colour lies outside [0, 1]; it is clamped",
                "{n} material colours lie outside [0, 1]; they are clamped",
            )
        return np.clip(color, 0.0, 1.0)


def _radiance(color: Float32[np.ndarray, "3"], where: str) -> tuple[float, float, float]:
    if not ((color >= 0.0).all() and (color <= LARGEST_RADIOMETRIC).all()):
        raise SceneFileError(
            f"{where}: Ke must be from 0 to {LARGEST_RADIOMETRIC:g}, got {', '.join(f'{c:g}' for c in color)}"
        )
    red, green, blue = color.tolist()
    return red, green, blue


def _leading_number(text: str, absent: float) -> float:
    """What is no number counts as absent: opacity changes no image, so it makes no scene unusable."""
    words = text.split()
    return plain_number(words[0]) if words and _is_number(words[0]) else absent


def _is_number(word: str) -> bool:
    try:
        plain_number(word)
    except ValueError:
        return False
    return True
