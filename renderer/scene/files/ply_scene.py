"""Reader for Stanford PLY. A scene gets one mesh.

trimesh 5.2 is not used because it applies the corner count of a binary file's first face to all faces, splits
concave faces as fans, and silently drops what it cannot match.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float32, Float64, Int64

from vpltune.renderer.files.srgb import linear_from_srgb
from vpltune.renderer.scene.files.diagnostics import SceneFileError, Warnings, label
from vpltune.renderer.scene.files.image_texels import MTL_FORMATS, ImageDecoder
from vpltune.renderer.scene.files.limits import LARGEST_NUMBER, DecodedBytes
from vpltune.renderer.scene.files.ply_data import PlyColumn, PlyData, PlyHeader, parse_ply_header
from vpltune.renderer.scene.files.polygon_triangulation import triangulated
from vpltune.renderer.scene.files.scene_folder import SceneFolder
from vpltune.renderer.scene.files.surface import Surface, finished_mesh
from vpltune.renderer.scene.scene import Instance, Material, Scene, Texture

# Property names in use for texture coordinates and colours. PLY itself defines none.
_UV_NAMES = (("u", "v"), ("s", "t"), ("texture_u", "texture_v"))
_COLOR_NAMES = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
# The value of white in each type.
_FULL_SCALE = {"B": 255.0, "H": 65535.0, "f": 1.0, "d": 1.0}

Columns = dict[str, PlyColumn]


def read_ply(path: Path, warnings: Warnings) -> Scene:
    """Read a PLY file. Colours of any type are sRGB-encoded, and v points up in images.

    Args:
        path: the file; its texture must be in the same folder or below.
        warnings: takes a line for each thing that is ignored or approximated.

    Raises:
        SceneFileError: header or data break a rule, the data are cut off, or an index is out of range.
    """
    folder = SceneFolder(path)
    content = folder.read_scene_file(path)
    header = parse_ply_header(content)
    decoded = DecodedBytes()
    data = PlyData(content, header, decoded)
    elements = {element.name: data.read(element) for element in header.elements}
    if data.left:
        warnings.add("data after the last element are ignored")
    for name in elements.keys() - {"vertex", "face"}:
        warnings.add(f"element {name!r:.40} is ignored")
    surface = _surface(elements.get("vertex", {}), elements.get("face", {}), warnings)
    name = label(path.stem, "mesh")
    mesh = None if surface is None else finished_mesh(surface, name, 0, decoded, "element 'face'")
    has_uv = surface is not None and surface.uv is not None
    textures = () if mesh is None or not has_uv else _textures(header, folder, warnings)
    if header.texture_name and not textures:
        warnings.add(f"texture {header.texture_name!r:.80} is not used; white is used instead")
    return Scene(
        name=name,
        meshes=() if mesh is None else (mesh,),
        instances=() if mesh is None else (Instance(name, 0, np.eye(4)),),
        materials=(Material("default", np.ones(3, np.float32), 0 if textures else None),),
        textures=textures,
        warnings=warnings.lines(),
    )


def _surface(vertex: Columns, face: Columns, warnings: Warnings) -> Surface | None:
    indices = next((face[name] for name in ("vertex_indices", "vertex_index") if name in face), None)
    if indices is None or indices.sizes is None:
        if face:
            raise SceneFileError("element 'face': must have a list 'vertex_indices'")
        return None
    if not len(indices.values) or not vertex:
        return None
    positions = _stacked(vertex, ("x", "y", "z"), "element 'vertex'")
    if positions is None:
        raise SceneFileError("element 'vertex': must have x, y and z")
    corners = indices.values.astype(np.int64)
    if corners.min() < 0 or corners.max() >= len(positions) or (corners != indices.values).any():
        wrong = corners.max() if corners.max() >= len(positions) else corners.min()
        raise SceneFileError(f"element 'face': vertex indices must be below {len(positions)}, got {wrong}")
    triangles = _triangles(corners, indices.sizes, positions, warnings)
    normals = _stacked(vertex, ("nx", "ny", "nz"), "element 'vertex'")
    normals = None if normals is None else normals.astype(np.float32)
    attributes = (normals, _uv(vertex), _colors(vertex, warnings))
    corner_uv = _corner_uv(face, indices.sizes)
    corner_colors = None if attributes[2] is not None else _colors(face, warnings)
    if corner_uv is None and corner_colors is None:
        return Surface(positions.astype(np.float32), corners[triangles], *attributes)
    # Attributes of face corners need a vertex for each corner.
    normals, uv, colors = (None if rows is None else rows[corners] for rows in attributes)
    if corner_colors is not None:
        colors = np.repeat(corner_colors, indices.sizes, axis=0)
    return Surface(
        positions[corners].astype(np.float32),
        triangles,
        normals,
        uv if corner_uv is None else corner_uv,
        colors,
    )


def _triangles(
    corners: Int64[np.ndarray, " corners"],
    sizes: Int64[np.ndarray, " faces"],
    positions: Float64[np.ndarray, "vertices 3"],
    warnings: Warnings,
) -> Int64[np.ndarray, "triangles 3"]:
    """Triangles as indices into `corners`."""
    is_polygon = sizes >= 3
    if is_polygon.all():
        return triangulated(sizes, positions[corners], "element 'face'")
    warnings.add(f"{int((~is_polygon).sum())} faces of fewer than 3 corners are ignored")
    kept = np.flatnonzero(np.repeat(is_polygon, sizes))
    return kept[triangulated(sizes[is_polygon], positions[corners[kept]], "element 'face'")]


def _stacked(
    columns: Columns, names: tuple[str, ...], where: str
) -> Float64[np.ndarray, "rows columns"] | None:
    if not all(name in columns and columns[name].sizes is None for name in names):
        return None
    stacked = np.stack([columns[name].values for name in names], axis=1)
    if not (np.abs(stacked) <= LARGEST_NUMBER).all():
        raise SceneFileError(f"{where}: {', '.join(names)} must be finite")
    return stacked


def _uv(vertex: Columns) -> Float32[np.ndarray, "rows 2"] | None:
    for names in _UV_NAMES:
        uv = _stacked(vertex, names, "element 'vertex'")
        if uv is not None:
            return _flipped_v(uv)
    return None


def _corner_uv(face: Columns, sizes: Int64[np.ndarray, " faces"]) -> Float32[np.ndarray, "corners 2"] | None:
    texcoord = face.get("texcoord")
    if texcoord is None or texcoord.sizes is None or not texcoord.values.size:
        return None
    if (texcoord.sizes != 2 * sizes).any() or not (np.abs(texcoord.values) <= LARGEST_NUMBER).all():
        raise SceneFileError("element 'face': texcoord must have two finite numbers for each corner")
    return _flipped_v(texcoord.values.reshape(-1, 2))


def _flipped_v(uv: Float64[np.ndarray, "rows 2"]) -> Float32[np.ndarray, "rows 2"]:
    return (uv * (1.0, -1.0) + (0.0, 1.0)).astype(np.float32)


def _colors(columns: Columns, warnings: Warnings) -> Float32[np.ndarray, "rows 3"] | None:
    for names in _COLOR_NAMES:
        encoded = _stacked(columns, names, "colours")
        if encoded is not None:
            encoded = encoded / _FULL_SCALE.get(columns[names[0]].type, 255.0)
            if encoded.min() < 0.0 or encoded.max() > 1.0:
                warnings.add("vertex colours outside [0, 1] are clamped")
            return linear_from_srgb(np.clip(encoded, 0.0, 1.0).astype(np.float32))
    return None


def _textures(header: PlyHeader, folder: SceneFolder, warnings: Warnings) -> tuple[Texture, ...]:
    name = header.texture_name
    if not name:
        return ()
    try:
        content = folder.read(name.replace("\\", "/"), "TextureFile")
    except SceneFileError as error:
        warnings.add(str(error))
        return ()
    texels = ImageDecoder(MTL_FORMATS).decode(content, f"TextureFile {name!r:.80}")
    return (Texture(label(name, "TextureFile"), texels),)
