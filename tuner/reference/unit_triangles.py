"""A scene as one list of triangles in unit space: centred, with a bounding-box diagonal of 1.

Ray tracing needs small distances, such as the offset of a ray from its surface. In unit space they are fixed
fractions of the scene, so a scene is traced the same way at any scale.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Float64, Int64, UInt32

from vpltune.renderer.errors import InputError
from vpltune.renderer.scene.scene import Instance, Light, Mesh, Scene
from vpltune.renderer.scene.transforms import transform_normals, transform_points

WRAP_MODES = ("repeat", "mirrored_repeat", "clamp_to_edge")
"""A wrap mode is stored as its index in this tuple."""


@dataclass(frozen=True, eq=False)
class UnitTriangles:
    """All triangles of a scene's instances, in unit space, and their textures packed end to end."""

    center_world: Float64[np.ndarray, "3"]
    """Centre of the bounding box."""
    diagonal: float
    """Length of the bounding-box diagonal in world units, > 0."""
    positions: Float32[np.ndarray, "vertices 3"]
    normals: Float32[np.ndarray, "vertices 3"]
    """Unit length, or zero where a node scales an axis to zero."""
    uv: Float32[np.ndarray, "vertices 2"]
    colors: Float32[np.ndarray, "vertices 3"]
    """Vertex colour times the material's base colour."""
    triangles: UInt32[np.ndarray, "triangles 3"]
    geometric_normals: Float32[np.ndarray, "triangles 3"]
    """Unit length, oriented by winding; zero for a triangle without area, which no ray hits."""
    triangle_textures: UInt32[np.ndarray, " triangles"]
    """Row of `textures`. Row 0 is a single white texel, for materials without a texture."""
    textures: UInt32[np.ndarray, "textures 5"]
    """First texel, width, height, and the wrap modes along u and v as indices into `WRAP_MODES`."""
    texels: UInt32[np.ndarray, " texels"]
    """sRGB bytes, red in the lowest, and opacity in the highest."""
    triangle_alphas: UInt32[np.ndarray, " triangles"]
    """Row of `alphas`. Row 0 is that of opaque materials."""
    alphas: Float32[np.ndarray, "materials 3"]
    """Opacity, cutoff, and 1 if blended."""
    triangle_emissions: UInt32[np.ndarray, " triangles"]
    """Row of `emissions`. Row 0 is that of materials that do not glow."""
    emissions: Float32[np.ndarray, "emissions 4"]
    """Radiance in W/(m² sr), RGB, and the side that glows: 1 where `geometric_normals` point, −1 the other, 0
    both."""
    emission_textures: UInt32[np.ndarray, " emissions"]
    """Row of `textures`, a factor of the emission."""

    @property
    def glows(self) -> bool:
        """Whether a surface emits light of its own."""
        return len(self.emissions) > 1

    @property
    def has_holes(self) -> bool:
        """Whether a surface is not opaque."""
        return len(self.alphas) > 1

    def to_unit(self, points_world: Float[np.ndarray, "*n 3"]) -> Float64[np.ndarray, "*n 3"]:
        """Map points from world to unit space."""
        return (points_world - self.center_world) / self.diagonal

    def unit_intensity(self, light: Light) -> Float64[np.ndarray, "3"]:
        """The intensity that gives the same irradiance in unit space: W/sr scale with length squared."""
        return light.intensity if light.kind == "directional" else light.intensity / self.diagonal**2


def unit_triangles(scene: Scene) -> UnitTriangles:
    """Transform, merge and rescale a scene's triangles.

    Raises:
        InputError: the scene has no triangles or no extent, an index is out of range, or a vertex attribute
            is not finite.
    """
    for mesh in scene.meshes:
        _check_mesh(scene, mesh)
    placed = [i for i in scene.instances if len(scene.meshes[i.mesh].triangles)]
    if not placed:
        raise InputError(f"{scene.name}: a scene must hold at least one triangle, got none")
    meshes = [scene.meshes[i.mesh] for i in placed]
    points = [
        transform_points(i.to_world, mesh.positions[np.unique(mesh.triangles)])
        for i, mesh in zip(placed, meshes, strict=True)
    ]
    low = np.min([p.min(axis=0) for p in points], axis=0)
    high = np.max([p.max(axis=0) for p in points], axis=0)
    diagonal = float(np.linalg.norm(high - low))
    if not (np.isfinite(diagonal) and diagonal > 0.0):
        raise InputError(f"{scene.name}: the scene's extent must be positive and finite, got {diagonal}")
    center = (low + high) / 2.0

    first_vertex = np.cumsum([0] + [len(mesh.positions) for mesh in meshes])
    positions = np.concatenate(
        [
            (transform_points(i.to_world, mesh.positions) - center) / diagonal
            for i, mesh in zip(placed, meshes, strict=True)
        ]
    )
    triangles = np.concatenate(
        [
            mesh.triangles.astype(np.int64) + first
            for mesh, first in zip(meshes, first_vertex[:-1], strict=True)
        ]
    )
    sizes = [len(mesh.triangles) for mesh in meshes]
    texture_of = [_texture_row(scene.materials[mesh.material].texture) for mesh in meshes]
    alpha_of, alphas = _alphas(scene, meshes)
    emission_of, emissions, emission_textures = _emissions(scene, placed)
    textures, texels = _packed_textures(scene)
    return UnitTriangles(
        center_world=center,
        diagonal=diagonal,
        positions=positions.astype(np.float32),
        normals=np.concatenate(
            [transform_normals(i.to_world, mesh.normals) for i, mesh in zip(placed, meshes, strict=True)]
        ).astype(np.float32),
        uv=np.concatenate([mesh.uv for mesh in meshes]).astype(np.float32),
        colors=np.concatenate([mesh.colors * scene.materials[mesh.material].base_color for mesh in meshes]),
        triangles=triangles.astype(np.uint32),
        geometric_normals=_geometric_normals(positions, triangles),
        triangle_textures=np.repeat(texture_of, sizes).astype(np.uint32),
        textures=textures,
        texels=texels,
        triangle_alphas=np.repeat(alpha_of, sizes).astype(np.uint32),
        alphas=alphas,
        triangle_emissions=np.repeat(emission_of, sizes).astype(np.uint32),
        emissions=emissions,
        emission_textures=emission_textures,
    )


def _check_mesh(scene: Scene, mesh: Mesh) -> None:
    where = f"{scene.name}: mesh '{mesh.name}'"
    if mesh.triangles.size and not 0 <= mesh.triangles.min() <= mesh.triangles.max() < len(mesh.positions):
        raise InputError(
            f"{where}: vertex indices must lie in [0, {len(mesh.positions)}), "
            f"got {mesh.triangles.min()} to {mesh.triangles.max()}"
        )
    if not 0 <= mesh.material < len(scene.materials):
        raise InputError(f"{where}: material must lie in [0, {len(scene.materials)}), got {mesh.material}")
    material = scene.materials[mesh.material]
    for name, texture in (("texture", material.texture), ("emission_texture", material.emission_texture)):
        if texture is not None and not 0 <= texture < len(scene.textures):
            raise InputError(f"{where}: {name} must lie in [0, {len(scene.textures)}), got {texture}")
    if not all(0.0 <= value < np.inf for value in material.emission):
        raise InputError(f"{where}: emission must be finite and at least 0, got {material.emission}")
    for attribute in ("positions", "normals", "uv", "colors"):
        if not np.isfinite(getattr(mesh, attribute)).all():
            raise InputError(f"{where}: {attribute} must be finite")


def _texture_row(texture: int | None) -> int:
    return 0 if texture is None else texture + 1


def _alphas(scene: Scene, meshes: list[Mesh]) -> tuple[list[int], Float32[np.ndarray, "materials 3"]]:
    """The row of each mesh's material, and the rows: one for all that is opaque, then one for each other."""
    used = sorted({mesh.material for mesh in meshes if not scene.materials[mesh.material].is_opaque})
    others = [scene.materials[i] for i in used]
    rows = [(1.0, 0.0, 0.0), *((each.opacity, each.alpha_cutoff, each.is_blended) for each in others)]
    row_of = {material: row for row, material in enumerate(used, start=1)}
    return [row_of.get(mesh.material, 0) for mesh in meshes], np.array(rows, np.float32)


def _emissions(
    scene: Scene, placed: list[Instance]
) -> tuple[list[int], Float32[np.ndarray, "emissions 4"], UInt32[np.ndarray, " emissions"]]:
    """The row of each instance, and the rows: one for all that is dark, then one for each lamp material."""
    row_of: list[int] = []
    rows: dict[int, int] = {}
    emissions, textures = [(0.0, 0.0, 0.0, 0.0)], [0]
    for instance in placed:
        index = scene.meshes[instance.mesh].material
        material = scene.materials[index]
        if material.glows and index not in rows:
            rows[index] = len(emissions)
            emissions.append((*material.emission, 0.0 if material.emits_both_ways else 1.0))
            textures.append(_texture_row(material.emission_texture))
        row_of.append(rows.get(index, 0))
    return row_of, np.array(emissions, np.float32), np.array(textures, np.uint32)


def _packed_textures(
    scene: Scene,
) -> tuple[UInt32[np.ndarray, "textures 5"], UInt32[np.ndarray, " texels"]]:
    rows = [(0, 1, 1, 0, 0)]
    texels: list[np.ndarray] = [np.array([0xFFFFFFFF], np.uint32)]
    first = 1
    for texture in scene.textures:
        height, width, _ = texture.texels_srgb.shape
        rows.append(
            (first, width, height, WRAP_MODES.index(texture.wrap_u), WRAP_MODES.index(texture.wrap_v))
        )
        red, green, blue = texture.texels_srgb.reshape(-1, 3).T.astype(np.uint32)
        opacity = np.uint32(255) if texture.opacity is None else texture.opacity.ravel().astype(np.uint32)
        texels.append(red | green << 8 | blue << 16 | opacity << 24)
        first += width * height
    if first >= 2**31:
        raise InputError(f"{scene.name}: textures must hold fewer than 2^31 texels in all, got {first}")
    return np.array(rows, np.uint32), np.concatenate(texels)


def _geometric_normals(
    positions: Float64[np.ndarray, "vertices 3"], triangles: Int64[np.ndarray, "triangles 3"]
) -> Float32[np.ndarray, "triangles 3"]:
    corner = positions[triangles]
    normals = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.divide(normals, length, out=np.zeros_like(normals), where=length > 0.0).astype(np.float32)


def srgb_decode_table() -> Float32[np.ndarray, "256"]:
    """Linear value of each sRGB byte (IEC 61966-2-1)."""
    encoded = np.arange(256) / 255.0
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return linear.astype(np.float32)
