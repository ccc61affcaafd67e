"""Wavefront MTL: the diffuse colour and map of materials. A diffuse material has no use for the rest."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float32

from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings, label, one_line
from vpltune.renderer.scene.files.image_texels import MTL_FORMATS, ImageDecoder
from vpltune.renderer.scene.files.scene_folder import SceneFolder
from vpltune.renderer.scene.scene import Material, Texture, Wrap

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


@dataclass(eq=False)
class _Definition:
    diffuse: Float32[np.ndarray, "3"] = field(default_factory=lambda: np.ones(3, np.float32))
    map_path: str = ""
    wrap: Wrap = "repeat"


class MtlMaterials:
    """The materials of an OBJ file. Libraries define them; `add` creates them when they are used."""

    def __init__(self, folder: SceneFolder, warnings: Warnings) -> None:
        self._folder = folder
        self._warnings = warnings
        self._decoder = ImageDecoder(MTL_FORMATS)
        self._definitions: dict[str, _Definition] = {}
        self._texture_indices: dict[tuple[str, Wrap], int | None] = {}
        self._missing_maps: list[str] = []
        self.materials: list[Material] = []
        self.textures: list[Texture] = []

    def read_library(self, names: str) -> None:
        """Read the libraries of an `mtllib` line: one file whose name may have spaces, or several files.

        A library that cannot be read adds a warning.

        Raises:
            SceneFileError: a library breaks a rule.
        """
        try:
            self._read_one(names)
        except FileNotFoundError:
            for name in names.split():
                try:
                    self._read_one(name)
                except FileNotFoundError:
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
        self.materials.append(Material(label(name, "default"), definition.diffuse, self._texture(definition)))
        return len(self.materials) - 1

    def say_what_is_missing(self) -> None:
        """Add one warning for all maps that could not be read."""
        if self._missing_maps:
            self._warnings.add(
                f"{len(self._missing_maps)} texture{'s' * (len(self._missing_maps) > 1)} missing "
                f"({one_line(self._missing_maps[0], 80)!r}{', …' * (len(self._missing_maps) > 1)}); "
                "Kd alone is used, or white without it"
            )

    def _texture(self, definition: _Definition) -> int | None:
        if not definition.map_path:
            return None
        key = (definition.map_path, definition.wrap)
        if key not in self._texture_indices:
            self._texture_indices[key] = self._read_texture(definition)
        return self._texture_indices[key]

    def _read_texture(self, definition: _Definition) -> int | None:
        path = definition.map_path.replace("\\", "/")
        try:
            content = self._folder.read(path, "map_Kd")
        except SceneFileError:
            self._missing_maps.append(definition.map_path)
            return None
        texels = self._decoder.decode(content, f"map_Kd {path!r:.80}")
        self.textures.append(Texture(label(path, "map_Kd"), texels, definition.wrap, definition.wrap))
        return len(self.textures) - 1

    def _read_one(self, name: str) -> None:
        try:
            content = self._folder.read(name.replace("\\", "/"), "mtllib")
        except SceneFileError as error:
            raise FileNotFoundError(name) from error
        definition: _Definition | None = None
        for number, line in enumerate(content.decode("utf-8", "replace").splitlines(), 1):
            words = line.split("#", 1)[0].split(None, 1)
            if not words:
                continue
            keyword, rest = words[0], words[1].strip() if len(words) > 1 else ""
            where = f"{name!r:.80} line {number}"
            if keyword == "newmtl":
                definition = self._definitions.setdefault(rest, _Definition())
            elif definition is not None:
                self._read_statement(definition, keyword, rest, where)

    def _read_statement(self, definition: _Definition, keyword: str, rest: str, where: str) -> None:
        if keyword == "Kd":
            definition.diffuse = self._albedo(self._color(rest, where))
        elif keyword.lower() == "map_kd":
            self._read_map(definition, rest)
        elif keyword == "Ke" and self._color(rest, where).any():
            self._warnings.tally(
                "1 material emits light; emission does not light the scene yet",
                "{n} materials emit light; emission does not light the scene yet",
            )
        elif keyword in ("map_d", "map_Tr"):
            self._warnings.tally(
                "1 material has an opacity map; it is drawn opaque",
                "{n} materials have opacity maps; they are drawn opaque",
            )

    def _color(self, rest: str, where: str) -> Float32[np.ndarray, "3"]:
        words = rest.split()
        if words and words[0] in ("spectral", "xyz"):
            self._warnings.add(f"colours given as {words[0]} are not supported; white is used")
            return np.ones(3, np.float32)
        try:
            color = np.array(words[:3] * (3 if len(words) == 1 else 1), np.float32)
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

    def _read_map(self, definition: _Definition, rest: str) -> None:
        words = rest.split()
        at = 0
        while at < len(words) and words[at].startswith("-") and at + 1 < len(words):
            option = words[at]
            if option == "-clamp" and words[at + 1] == "on":
                definition.wrap = "clamp_to_edge"
            if option in _TRANSFORMS:
                self._warnings.add(f"map_Kd option {option} is ignored")
                at += 1
                while at < len(words) - 1 and _is_number(words[at]):
                    at += 1
            else:
                at += 1 + _MAP_OPTIONS.get(option, 0)
        # The path is the rest of the line, including spaces.
        definition.map_path = rest.split(None, at)[at] if at < len(words) else ""


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
