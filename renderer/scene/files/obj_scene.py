"""Reader for Wavefront OBJ. A scene gets one mesh for each material.

trimesh 5.2 is not used because it splits concave faces as fans, counts negative indices from the end of the
file instead of from the current line, and silently drops normals, textures and whole materials.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Float64, Int64

from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings, label
from vpltune.renderer.scene.files.limits import DecodedBytes
from vpltune.renderer.scene.files.mtl_materials import MtlMaterials
from vpltune.renderer.scene.files.polygon_triangulation import triangulated
from vpltune.renderer.scene.files.scene_folder import SceneFolder
from vpltune.renderer.scene.files.surface import Surface, finished_mesh, used_vertices
from vpltune.renderer.scene.scene import Instance, Mesh, Scene

# Grouping, levels of detail and display hints, which do not change the surface: no warning for these.
_SILENT_KEYWORDS = frozenset(
    (
        "o",
        "g",
        "s",
        "mg",
        "lod",
        "usemap",
        "maplib",
        "bevel",
        "c_interp",
        "d_interp",
        "shadow_obj",
        "trace_obj",
    )
)
# Free-form curves and surfaces, which are ignored with a warning.
_FREE_FORM_KEYWORDS = frozenset(
    (
        "vp",
        "cstype",
        "deg",
        "bmat",
        "step",
        "curv",
        "curv2",
        "surf",
        "parm",
        "trim",
        "hole",
        "scrv",
        "sp",
        "end",
        "con",
        "ctech",
        "stech",
    )
)
# Estimated memory in bytes of the Python objects for one line while the text is parsed.
_BYTES_PER_LINE = 300


@dataclass
class _Faces:
    """Faces of one material: corners as indices into `_ObjText.corners`, and each face's corner count."""

    corners: list[int] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)


@dataclass
class _ObjText:
    """The parsed lines of an OBJ file."""

    vertices: list[list[str]] = field(default_factory=list)
    uvs: list[list[str]] = field(default_factory=list)
    normals: list[list[str]] = field(default_factory=list)
    corners: dict[tuple[int, int, int], int] = field(default_factory=dict)
    """The index of each distinct (vertex, uv, normal). These count from 0; −1 if absent."""
    faces: dict[str, _Faces] = field(default_factory=dict)
    libraries: list[str] = field(default_factory=list)


def read_obj(path: Path, warnings: Warnings) -> Scene:
    """Read an OBJ file. Kd is linear, maps and vertex colours are sRGB-encoded, and v points up in images.

    Args:
        path: the file; its material libraries and maps must be in the same folder or below.
        warnings: takes a line for each thing that is ignored or approximated.

    Raises:
        SceneFileError: the text breaks a rule, an index is out of range, or a number is not finite.
    """
    folder = SceneFolder(path)
    content = folder.read_scene_file(path)
    if b"\0" in content:
        raise SceneFileError("must be text in UTF-8 or an eight-bit encoding")
    decoded = DecodedBytes()
    decoded.spend(_BYTES_PER_LINE * content.count(b"\n"), "the text")
    text = _parse(content.decode("utf-8", "replace"), warnings)
    materials = MtlMaterials(folder, warnings)
    for library in text.libraries:
        materials.read_library(library)
    meshes = _meshes(text, materials, warnings, decoded, label(path.stem, "mesh"))
    materials.say_what_is_missing()
    return Scene(
        name=label(path.stem, "scene"),
        meshes=tuple(meshes),
        instances=tuple(Instance(mesh.name, index, np.eye(4)) for index, mesh in enumerate(meshes)),
        materials=tuple(materials.materials),
        textures=tuple(materials.textures),
        warnings=warnings.lines(),
    )


def _parse(content: str, warnings: Warnings) -> _ObjText:
    text = _ObjText()
    faces = text.faces.setdefault("", _Faces())
    for number, line in enumerate(content.replace("\\\r\n", " ").replace("\\\n", " ").split("\n"), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        keyword = words[0]
        if keyword == "v":
            text.vertices.append(words[1:])
        elif keyword == "vt":
            text.uvs.append(words[1:])
        elif keyword == "vn":
            text.normals.append(words[1:])
        elif keyword in ("f", "fo"):
            _parse_face(words, text, faces, f"line {number}", warnings)
        elif keyword == "usemtl":
            faces = text.faces.setdefault(_rest(line), _Faces())
        elif keyword == "mtllib":
            text.libraries.append(_rest(line))
        elif keyword in ("p", "l"):
            warnings.tally("1 point or line element is ignored", "{n} point or line elements are ignored")
        elif keyword in _FREE_FORM_KEYWORDS:
            warnings.add("free-form curves and surfaces are ignored")
        elif keyword not in _SILENT_KEYWORDS:
            warnings.tally(
                "1 line with an unknown keyword is ignored", "{n} lines with unknown keywords are ignored"
            )
    return text


def _rest(line: str) -> str:
    words = line.strip().split(None, 1)
    return words[1].strip() if len(words) > 1 else ""


def _parse_face(words: list[str], text: _ObjText, faces: _Faces, where: str, warnings: Warnings) -> None:
    if len(words) < 4:
        warnings.tally(
            "1 face of fewer than 3 corners is ignored", "{n} faces of fewer than 3 corners are ignored"
        )
        return
    for word in words[1:]:
        faces.corners.append(_corner(word, text, where))
    faces.sizes.append(len(words) - 1)


def _corner(word: str, text: _ObjText, where: str) -> int:
    """The index of a corner written as `v`, `v/vt`, `v//vn` or `v/vt/vn`."""
    parts = word.split("/")
    lists = (text.vertices, text.uvs, text.normals)
    resolved = [-1, -1, -1]
    if len(parts) > 3 or not parts[0]:
        raise SceneFileError(f"{where}: a corner must be written v, v/vt, v//vn or v/vt/vn, got {word!r:.40}")
    for i, part in enumerate(parts):
        if not part:
            continue
        try:
            index = int(part)
        except ValueError:
            index = 0
        # Forward references are allowed and checked at the end. Negative indices count back from this line.
        resolved[i] = index - 1 if index > 0 else len(lists[i]) + index
        if index == 0 or resolved[i] < 0:
            raise SceneFileError(
                f"{where}: an index must be a whole number other than 0 and in range, got {word!r:.40}"
            )
    key = (resolved[0], resolved[1], resolved[2])
    return text.corners.setdefault(key, len(text.corners))


def _meshes(
    text: _ObjText, materials: MtlMaterials, warnings: Warnings, decoded: DecodedBytes, name: str
) -> list[Mesh]:
    if not text.corners:
        return []
    keys = np.array(list(text.corners), np.int64)
    vertices, colors = _vertices(text.vertices, warnings)
    pools = (vertices, _numbers(text.uvs, 2, "vt"), _numbers(text.normals, 3, "vn"))
    for column, (pool, keyword) in enumerate(zip(pools, ("v", "vt", "vn"), strict=True)):
        if keys[:, column].max() >= len(pool):
            raise SceneFileError(
                f"faces: {keyword} index must be at most {len(pool)}, got {keys[:, column].max() + 1}"
            )
    meshes = []
    for material, faces in text.faces.items():
        if not faces.sizes:
            continue
        corners, sizes = np.array(faces.corners, np.int64), np.array(faces.sizes, np.int64)
        cut = triangulated(sizes, vertices[keys[corners, 0]], f"material {material!r:.60}")
        used, renumbered = used_vertices(corners[cut.ravel()], len(keys))
        surface = _surface(keys[used], renumbered.reshape(-1, 3), pools, colors)
        index = materials.add(material)
        if materials.materials[index].texture is not None and (keys[used, 1] < 0).any():
            warnings.add("corners without vt are textured at (0, 0)")
        mesh = finished_mesh(surface, label(material, name), index, decoded, f"material {material!r:.60}")
        meshes += [] if mesh is None else [mesh]
    return meshes


def _surface(
    keys: Int64[np.ndarray, "used 3"],
    triangles: Int64[np.ndarray, "triangles 3"],
    pools: tuple[Float64[np.ndarray, "v 3"], Float64[np.ndarray, "vt 2"], Float64[np.ndarray, "vn 3"]],
    colors: Float32[np.ndarray, "v 3"] | None,
) -> Surface:
    vertices, uvs, normals = pools
    uv = normal = None
    if (keys[:, 1] >= 0).any():
        # Corners without a uv have the index −1, which picks the row of zeros at the end.
        uv = np.concatenate([uvs * (1.0, -1.0) + (0.0, 1.0), np.zeros((1, 2))])[keys[:, 1]].astype(np.float32)
    if (keys[:, 2] >= 0).any():
        normal = np.concatenate([normals, np.zeros((1, 3))])[keys[:, 2]].astype(np.float32)
    return Surface(
        vertices[keys[:, 0]].astype(np.float32),
        triangles,
        normal,
        uv,
        None if colors is None else colors[keys[:, 0]],
    )


def _vertices(
    lines: list[list[str]], warnings: Warnings
) -> tuple[Float64[np.ndarray, "v 3"], Float32[np.ndarray, "v 3"] | None]:
    """Positions, and vertex colours if any line has them: x y z r g b, or x y z w r g b."""
    positions = _numbers(lines, 3, "v")
    colored = [i for i, words in enumerate(lines) if len(words) >= 6]
    if not colored:
        return positions, None
    encoded = np.ones((len(lines), 3), np.float32)
    encoded[colored] = _numbers([lines[i][-3:] for i in colored], 3, "v colour").astype(np.float32)
    if encoded.min() < 0.0 or encoded.max() > 1.0:
        warnings.add("vertex colours outside [0, 1] are clamped")
    return positions, linear_from_srgb(np.clip(encoded, 0.0, 1.0))


def _numbers(lines: list[list[str]], count: int, keyword: str) -> Float64[np.ndarray, "lines count"]:
    """The first `count` numbers of each line. A vt with one number gets 0 for the second."""
    if keyword == "vt":
        lines = [words if len(words) > 1 else [*words, "0"] for words in lines]
    try:
        values = np.array([words[:count] for words in lines], np.float64).reshape(len(lines), count)
    except ValueError:
        values = np.full((1, 1), np.nan)
    # Larger coordinates make no sense and would overflow float32.
    if not (np.abs(values) <= 1e30).all():
        bad = next((words for words in lines if not _all_finite(words[:count], count)), [])
        raise SceneFileError(f"{keyword}: must be {count} finite numbers, got {' '.join(bad)!r:.60}")
    return values


def _all_finite(words: list[str], count: int) -> bool:
    try:
        return len(words) == count and all(abs(float(word)) <= 1e30 for word in words)
    except ValueError:
        return False
