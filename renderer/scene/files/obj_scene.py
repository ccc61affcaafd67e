"""Reader for Wavefront OBJ. A scene gets one mesh for each material.

trimesh 5.2 is not used because it splits concave faces as fans, counts negative indices from the end of the
file instead of from the current line, and silently drops normals, textures and whole materials.
"""

from array import array
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from jaxtyping import Float32, Float64, Int32, Int64

from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings, label
from vpltune.renderer.scene.files.limits import MAX_INSTANCES, DecodedBytes
from vpltune.renderer.scene.files.mtl_materials import MtlMaterials
from vpltune.renderer.scene.files.plain_numbers import finite_numbers, plain_index
from vpltune.renderer.scene.files.polygon_triangulation import triangulated
from vpltune.renderer.scene.files.scene_folder import SceneFolder
from vpltune.renderer.scene.files.surface import Surface
from vpltune.renderer.scene.files.surface_parts import Part, batches, finished_meshes
from vpltune.renderer.scene.files.text_lines import first_word, text_lines, without_remark
from vpltune.renderer.scene.scene import Instance, Mesh, Scene

# Grouping, levels of detail and display hints, which do not change the surface: no warning for these.
_SILENT_KEYWORDS = frozenset(
    b"o g s mg lod usemap maplib bevel c_interp d_interp shadow_obj trace_obj".split()
)
# Free-form curves and surfaces, which are ignored with a warning.
_FREE_FORM_KEYWORDS = frozenset(
    b"vp cstype deg bmat step curv curv2 surf parm trim hole scrv sp end con ctech stech".split()
)
# Bytes of memory for a v, vt or vn line, and for a corner of a face: measured at the peak, with all copies.
_BYTES_PER_LINE, _BYTES_PER_CORNER = 64, 100


@dataclass
class _ObjText:
    """The parsed lines of an OBJ file in flat arrays, since Python objects take ten times the memory."""

    decoded: DecodedBytes
    vertices: array = field(default_factory=lambda: array("d"))
    """Three numbers for each v."""
    colors: array = field(default_factory=lambda: array("d"))
    """Three numbers for each v that has a colour."""
    colored: array = field(default_factory=lambda: array("i"))
    """Which these are."""
    uvs: array = field(default_factory=lambda: array("d"))
    """Two numbers for each vt."""
    normals: array = field(default_factory=lambda: array("d"))
    """Three numbers for each vn."""
    corners: array = field(default_factory=lambda: array("i"))
    """Vertex, uv and normal of every face's corners, from 0; −1 if absent."""
    sizes: array = field(default_factory=lambda: array("i"))
    """Corner count of each face."""
    face_materials: array = field(default_factory=lambda: array("i"))
    """Each face's material, as its place in `materials`."""
    materials: dict[str, int] = field(default_factory=dict)
    """The names that faces use, with their place."""
    libraries: dict[str, None] = field(default_factory=dict)


def read_obj(path: Path, warnings: Warnings) -> Scene:
    """Read an OBJ file. Kd is linear, maps and vertex colours are sRGB-encoded, and v points up in images.

    Args:
        path: the file; its material libraries and maps must be in the same folder or below.
        warnings: takes a line for each thing that is ignored or approximated.

    Raises:
        SceneFileError: the text breaks a rule, an index is out of range, or a number is not finite.
    """
    folder = SceneFolder(path)
    decoded = DecodedBytes()
    text = _parse(folder.read_scene_file(path), warnings, decoded)
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


def _parse(content: bytes, warnings: Warnings, decoded: DecodedBytes) -> _ObjText:
    text = _ObjText(decoded)
    material = ""
    for number, line in text_lines(content, ""):
        keyword = (line.split(None, 1) or [b"#"])[0]
        if keyword in (b"v", b"vt", b"vn"):
            _parse_numbers(keyword, _words(line), text, number)
        elif keyword in (b"f", b"fo"):
            _parse_face(_words(line), text, material, f"line {number}", warnings)
        elif keyword == b"usemtl":
            material = first_word(without_remark(line))[1]
        elif keyword == b"mtllib":
            text.libraries[library_names(line)] = None
        elif keyword in (b"p", b"l"):
            warnings.tally("1 point or line element is ignored", "{n} point or line elements are ignored")
        elif keyword in _FREE_FORM_KEYWORDS:
            warnings.add("free-form curves and surfaces are ignored")
        elif not keyword.startswith(b"#") and keyword not in _SILENT_KEYWORDS:
            warnings.tally(
                "1 line with an unknown keyword is ignored", "{n} lines with unknown keywords are ignored"
            )
    return text


def library_names(line: bytes) -> str:
    """What an `mtllib` line names: one library whose name may have spaces, or several."""
    return first_word(without_remark(line))[1]


def _words(line: bytes) -> list[bytes]:
    """The words after the keyword, without a comment at the line's end."""
    return line.split(b"#", 1)[0].split()[1:]


def _parse_numbers(keyword: bytes, words: list[bytes], text: _ObjText, number: int) -> None:
    """A v, vt or vn line. A v may have a colour: x y z r g b, or x y z w r g b."""
    text.decoded.spend(_BYTES_PER_LINE, "the vertices")
    what = f"line {number}: {keyword.decode()}"
    if keyword == b"vt":
        # A vt with one number gets 0 for the second.
        text.uvs.extend(finite_numbers([*words, b"0"] if len(words) == 1 else words, 2, what))
    elif keyword == b"vn":
        text.normals.extend(finite_numbers(words, 3, what))
    else:
        if len(words) >= 6:
            text.colored.append(len(text.vertices) // 3)
            text.colors.extend(finite_numbers(words[-3:], 3, f"{what} colour"))
        text.vertices.extend(finite_numbers(words, 3, what))


def _parse_face(words: list[bytes], text: _ObjText, material: str, where: str, warnings: Warnings) -> None:
    if len(words) < 3:
        warnings.tally(
            "1 face of fewer than 3 corners is ignored", "{n} faces of fewer than 3 corners are ignored"
        )
        return
    text.decoded.spend(_BYTES_PER_CORNER * len(words), "the faces")
    counts = (len(text.vertices) // 3, len(text.uvs) // 2, len(text.normals) // 3)
    for word in words:
        text.corners.extend(_corner(word, counts, where))
    text.sizes.append(len(words))
    if material not in text.materials and len(text.materials) == MAX_INSTANCES:
        raise SceneFileError(f"{where}: faces must use at most {MAX_INSTANCES:,} materials, got more")
    text.face_materials.append(text.materials.setdefault(material, len(text.materials)))


def _corner(word: bytes, counts: tuple[int, int, int], where: str) -> list[int]:
    """Vertex, uv and normal of a corner written as `v`, `v/vt`, `v//vn` or `v/vt/vn`."""
    parts = word.split(b"/")
    resolved = [-1, -1, -1]
    if len(parts) > 3 or not parts[0]:
        shown = word.decode("utf-8", "replace")
        raise SceneFileError(
            f"{where}: a corner must be written v, v/vt, v//vn or v/vt/vn, got {shown!r:.40}"
        )
    for i, part in enumerate(parts):
        if not part:
            continue
        try:
            index = plain_index(part)
        except ValueError:
            index = 0
        # Forward references are allowed and checked at the end. Negative indices count back from this line.
        resolved[i] = index - 1 if index > 0 else counts[i] + index
        if index == 0 or resolved[i] < 0:
            shown = word.decode("utf-8", "replace")
            raise SceneFileError(
                f"{where}: an index must be a whole number other than 0 and in range, got {shown!r:.40}"
            )
    return resolved


def _meshes(
    text: _ObjText, materials: MtlMaterials, warnings: Warnings, decoded: DecodedBytes, name: str
) -> list[Mesh]:
    if not text.sizes:
        return []
    vertices, colors = _vertices(text, warnings)
    pools = (vertices, _rows(text.uvs, 2), _rows(text.normals, 3))
    keys, material_of_key, key_of_corner = _distinct(text, pools)
    material_of_face, sizes, corners = _by_material(text, key_of_corner)
    names = [f"material {name!r:.60}" for name in text.materials]
    # If the largest face has too many corners, it is refused.
    cut = triangulated(sizes, vertices[keys[corners, 0]], names[material_of_face[sizes.argmax()]])
    triangles = corners[cut]
    counts = [
        np.bincount(material_of_key, minlength=len(names)),
        np.bincount(np.repeat(material_of_face, sizes - 2), minlength=len(names)),
        np.bincount(material_of_key[keys[:, 1] >= 0], minlength=len(names)),
    ]
    parts: list[Part] = []
    for material, where, *own in zip(text.materials, names, *(each.tolist() for each in counts), strict=True):
        vertex_count, triangle_count, uv_count = own
        index = materials.add(material)
        if materials.materials[index].texture is not None and uv_count < vertex_count:
            warnings.add("corners without vt are textured at (0, 0)")
        parts.append(Part(label(material, name), index, where, vertex_count, triangle_count, uv_count > 0))
    meshes: list[Mesh] = []
    first_key = first_triangle = 0
    for batch in batches([part.triangle_count for part in parts]):
        end_key = first_key + sum(part.vertex_count for part in parts[batch])
        end_triangle = first_triangle + sum(part.triangle_count for part in parts[batch])
        surface = _surface(
            keys[first_key:end_key], triangles[first_triangle:end_triangle] - first_key, pools, colors
        )
        meshes += finished_meshes(surface, parts[batch], decoded)
        first_key, first_triangle = end_key, end_triangle
    return meshes


def _distinct(
    text: _ObjText, pools: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> tuple[Int64[np.ndarray, "keys 3"], Int32[np.ndarray, " keys"], Int64[np.ndarray, " corners"]]:
    """The distinct corners (vertex, uv, normal) of each material.

    Returns:
        The distinct corners, by material in the order of first use; the material of each; and for each corner
        in the file, which of them it is.
    """
    rows = np.frombuffer(text.corners, np.int32).reshape(-1, 3)
    for column, (pool, keyword) in enumerate(zip(pools, ("v", "vt", "vn"), strict=True)):
        if rows[:, column].max() >= len(pool):
            raise SceneFileError(
                f"faces: {keyword} index must be at most {len(pool)}, got {rows[:, column].max() + 1}"
            )
    # One number for the pair first: the product of all counts may exceed 64 bits.
    pairs = (rows[:, 1] + np.int64(1)) * (len(pools[2]) + 1) + (rows[:, 2] + 1)
    found, pair_of_corner = np.unique(pairs, return_inverse=True)
    # Below 2⁶⁰: MAX_INSTANCES materials are fewer than 2¹⁴, and MAX_DECODED_BYTES has room for fewer than 2²³
    # vertices and as many pairs.
    material = np.repeat(np.frombuffer(text.face_materials, np.int32), text.sizes)
    numbers = (material * np.int64(len(pools[0])) + rows[:, 0]) * len(found) + pair_of_corner.reshape(-1)
    _, first, key_of_corner = np.unique(numbers, return_index=True, return_inverse=True)
    return rows[first].astype(np.int64), material[first], key_of_corner.reshape(-1).astype(np.int64)


def _by_material(
    text: _ObjText, key_of_corner: Int64[np.ndarray, " corners"]
) -> tuple[Int32[np.ndarray, " faces"], Int64[np.ndarray, " faces"], Int64[np.ndarray, " corners"]]:
    """Material and corner count of each face, and their corners as distinct ones; by material."""
    sizes = np.frombuffer(text.sizes, np.int32).astype(np.int64)
    material_of_face = np.frombuffer(text.face_materials, np.int32)
    starts = np.cumsum(sizes) - sizes
    order = np.argsort(material_of_face, kind="stable")
    own = sizes[order]
    within = np.arange(own.sum()) - np.repeat(np.cumsum(own) - own, own)
    return material_of_face[order], own, key_of_corner[np.repeat(starts[order], own) + within]


def _surface(
    keys: Int64[np.ndarray, "used 3"],
    triangles: Int64[np.ndarray, "triangles 3"],
    pools: tuple[Float64[np.ndarray, "v 3"], Float64[np.ndarray, "vt 2"], Float64[np.ndarray, "vn 3"]],
    colors: Float32[np.ndarray, "v 3"] | None,
) -> Surface:
    vertices, uvs, normals = pools
    uv = _picked(uvs, keys[:, 1])
    # v points up in OBJ, and down from the first row in a scene. Corners without a uv have (0, 0) there.
    if uv is not None:
        uv[:, 1] = np.where(keys[:, 1] >= 0, 1.0 - uv[:, 1], 0.0)
    return Surface(
        vertices[keys[:, 0]].astype(np.float32),
        triangles,
        _picked(normals, keys[:, 2]),
        uv,
        None if colors is None else colors[keys[:, 0]],
    )


def _picked(
    pool: Float64[np.ndarray, "rows columns"], indices: Int64[np.ndarray, " used"]
) -> Float32[np.ndarray, "used columns"] | None:
    """Rows of the pool, zero where the index is −1; None if all are. Takes time for the used rows alone."""
    present = indices >= 0
    if not present.any():
        return None
    picked = np.zeros((len(indices), pool.shape[1]), np.float32)
    picked[present] = pool[indices[present]]
    return picked


def _vertices(
    text: _ObjText, warnings: Warnings
) -> tuple[Float64[np.ndarray, "v 3"], Float32[np.ndarray, "v 3"] | None]:
    """Positions, and vertex colours if any line has them, white for the others."""
    positions = _rows(text.vertices, 3)
    if not text.colored:
        return positions, None
    encoded = np.ones((len(positions), 3), np.float32)
    encoded[np.frombuffer(text.colored, np.int32)] = _rows(text.colors, 3)
    if encoded.min() < 0.0 or encoded.max() > 1.0:
        warnings.add("vertex colours outside [0, 1] are clamped")
    return positions, linear_from_srgb(np.clip(encoded, 0.0, 1.0))


def _rows(numbers: array, count: int) -> Float64[np.ndarray, "rows count"]:
    return np.array(numbers, np.float64).reshape(-1, count)
